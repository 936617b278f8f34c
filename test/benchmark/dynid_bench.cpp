// SPDX-License-Identifier: Apache-2.0
//
// The kernels against their peers on the published Panda: the same random states, one run, repetitions
// interleaved at random. Every engine is first checked against the others on every state.
//
//   dynid_bench [--json FILE] [any flag of Google Benchmark]
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#ifdef DYNID_WITH_PINOCCHIO
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/config.hpp>
#include <pinocchio/multibody/data.hpp>
#include <pinocchio/multibody/model.hpp>
#endif

#include "dynid/dynamics/dynamics.hpp"
#include "dynid/model/kdl.hpp"
#include "dynid/model/yaml.hpp"

namespace {

constexpr int n = 7;
constexpr int samples = 1024;
using Vector = Eigen::Matrix<double, n, 1>;
using Square = Eigen::Matrix<double, n, n>;
using Regressor = Eigen::Matrix<double, n, 10 * n>;
using PacketVector = Eigen::Matrix<dynid::Packet8, n, 1>;

struct State {
  Vector q, dq, ddq;
};

std::vector<State> random_states(const dynid::Robot& robot) {
  std::mt19937_64 generator(1);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<State> states(samples);
  for (State& s : states) {
    for (int i = 0; i < n; ++i) {
      const dynid::JointLimits& limits = robot.joints[i].limits;
      s.q[i] = 0.5 * (limits.lower + limits.upper) + 0.5 * (limits.upper - limits.lower) * unit(generator);
      s.dq[i] = limits.velocity * unit(generator);
      s.ddq[i] = limits.acceleration * unit(generator);
    }
  }
  return states;
}

/// This library.
struct Here {
  explicit Here(const dynid::Robot& robot) : model(robot), ws(model), packet_ws(model) {}
  dynid::Model<n> model;
  dynid::Workspace<n> ws;
  dynid::Workspace<n, dynid::Packet8> packet_ws;
  Vector tau;
  Square M, S;
  Regressor Y;
  PacketVector packet_tau;
};

struct Kdl {
  explicit Kdl(const dynid::Robot& robot)
      : chain(dynid::to_kdl(robot)),
        gravity(robot.gravity.x(), robot.gravity.y(), robot.gravity.z()),
        rne(chain, gravity),
        dynamics(chain, gravity),
        none(chain.getNrOfSegments(), KDL::Wrench::Zero()) {}
  KDL::Chain chain;
  KDL::Vector gravity;
  KDL::ChainIdSolver_RNE rne;
  KDL::ChainDynParam dynamics;
  KDL::Wrenches none;
  KDL::JntArray tau{n};
  KDL::JntSpaceInertiaMatrix M{n};
};

struct KdlState {
  KDL::JntArray q{n}, dq{n}, ddq{n};
};

#ifdef DYNID_WITH_PINOCCHIO
struct Pinocchio {
  explicit Pinocchio(const dynid::Robot& robot) {
    pinocchio::JointIndex parent = 0;
    for (const dynid::Joint& joint : robot.joints) {
      const pinocchio::SE3 origin(joint.origin.linear(), joint.origin.translation());
      const bool about_z = joint.axis == Eigen::Vector3d::UnitZ();
      if (about_z)  // the fastest kind that Pinocchio has
        parent = model.addJoint(parent, pinocchio::JointModelRZ(), origin, joint.name);
      else
        parent =
            model.addJoint(parent, pinocchio::JointModelRevoluteUnaligned(joint.axis), origin, joint.name);
      const dynid::LinkInertia link = dynid::from_standard(joint.parameters);
      model.appendBodyToJoint(parent, pinocchio::Inertia(link.mass, link.com, link.inertia));
    }
    model.gravity.linear(robot.gravity);
    data = pinocchio::Data(model);
  }
  pinocchio::Model model;
  pinocchio::Data data;
};
#endif

struct Engines {
  explicit Engines(const dynid::Robot& robot)
      : here(robot),
        kdl(robot),
#ifdef DYNID_WITH_PINOCCHIO
        pinocchio(robot),
#endif
        states(random_states(robot)),
        kdl_states(samples),
        packets(samples / 8) {
    for (int k = 0; k < samples; ++k) {
      kdl_states[k].q.data = states[k].q;
      kdl_states[k].dq.data = states[k].dq;
      kdl_states[k].ddq.data = states[k].ddq;
      for (int i = 0; i < n; ++i) {
        packets[k / 8].q[i][k % 8] = states[k].q[i];
        packets[k / 8].dq[i][k % 8] = states[k].dq[i];
        packets[k / 8].ddq[i][k % 8] = states[k].ddq[i];
      }
    }
  }
  struct Packet {
    PacketVector q, dq, ddq;
  };
  Here here;
  Kdl kdl;
#ifdef DYNID_WITH_PINOCCHIO
  Pinocchio pinocchio;
#endif
  std::vector<State> states;
  std::vector<KdlState> kdl_states;
  std::vector<Packet> packets;
};

/// The largest relative difference between engines over all states.
double disagreement(Engines& e) {
  double worst = 0.0;
  const auto see = [&](const auto& a, const auto& b) {
    worst = std::max(worst, (a - b).norm() / (1.0 + b.norm()));
  };
  for (int k = 0; k < samples; ++k) {
    const State& s = e.states[k];
    Here& h = e.here;
    dynid::inverse_dynamics(h.model, h.ws, s.q, s.dq, s.ddq, h.tau);
    dynid::regressor(h.model, h.ws, s.q, s.dq, s.ddq, h.Y);
    dynid::mass_matrix(h.model, h.ws, s.q, h.M);
    dynid::coriolis_matrix(h.model, h.ws, s.q, s.dq, h.S);
    const Engines::Packet& p = e.packets[k / 8];
    dynid::inverse_dynamics(h.model, h.packet_ws, p.q, p.dq, p.ddq, h.packet_tau);
    Vector lane;
    for (int i = 0; i < n; ++i) lane[i] = h.packet_tau[i][k % 8];
    see(lane, h.tau);
    const KdlState& ks = e.kdl_states[k];
    e.kdl.rne.CartToJnt(ks.q, ks.dq, ks.ddq, e.kdl.none, e.kdl.tau);
    e.kdl.dynamics.JntToMass(ks.q, e.kdl.M);
    see(e.kdl.tau.data, h.tau);
    see(e.kdl.M.data, h.M);
#ifdef DYNID_WITH_PINOCCHIO
    auto& [model, data] = e.pinocchio;
    see(pinocchio::rnea(model, data, s.q, s.dq, s.ddq), h.tau);
    see(pinocchio::computeJointTorqueRegressor(model, data, s.q, s.dq, s.ddq), h.Y);
    pinocchio::crba(model, data, s.q);
    see(Eigen::MatrixXd(data.M.selfadjointView<Eigen::Upper>()), h.M);
    // Pinocchio's factorisation need not be Christoffel's: what it multiplies to must agree.
    see(pinocchio::computeCoriolisMatrix(model, data, s.q, s.dq) * s.dq, h.S * s.dq);
#endif
  }
  return worst;
}

/// One benchmark: a sweep over all states an iteration.
template <class F>
void add(const char* name, int count, const F& f) {
  benchmark::RegisterBenchmark(name, [count, f](benchmark::State& state) {
    for (auto _ : state) {
      for (int k = 0; k < count; ++k) f(k);
      benchmark::ClobberMemory();
    }
    state.SetItemsProcessed(state.iterations() * samples);
  });
}

void register_all(Engines& e) {
  Here& h = e.here;
  const auto keep = [](auto& x) { benchmark::DoNotOptimize(x.data()); };
  add("inverse_dynamics/dynid", samples, [&e, &h, keep](int k) {
    const State& s = e.states[k];
    dynid::inverse_dynamics(h.model, h.ws, s.q, s.dq, s.ddq, h.tau);
    keep(h.tau);
  });
  add("inverse_dynamics_batched/dynid", samples / 8, [&e, &h, keep](int k) {
    const Engines::Packet& p = e.packets[k];
    dynid::inverse_dynamics(h.model, h.packet_ws, p.q, p.dq, p.ddq, h.packet_tau);
    keep(h.packet_tau);
  });
  add("regressor/dynid", samples, [&e, &h, keep](int k) {
    const State& s = e.states[k];
    dynid::regressor(h.model, h.ws, s.q, s.dq, s.ddq, h.Y);
    keep(h.Y);
  });
  add("mass_matrix/dynid", samples, [&e, &h, keep](int k) {
    dynid::mass_matrix(h.model, h.ws, e.states[k].q, h.M);
    keep(h.M);
  });
  add("coriolis_matrix/dynid", samples, [&e, &h, keep](int k) {
    dynid::coriolis_matrix(h.model, h.ws, e.states[k].q, e.states[k].dq, h.S);
    keep(h.S);
  });
  add("inverse_dynamics/kdl", samples, [&e](int k) {
    const KdlState& s = e.kdl_states[k];
    e.kdl.rne.CartToJnt(s.q, s.dq, s.ddq, e.kdl.none, e.kdl.tau);
  });
  add("mass_matrix/kdl", samples, [&e](int k) { e.kdl.dynamics.JntToMass(e.kdl_states[k].q, e.kdl.M); });
#ifdef DYNID_WITH_PINOCCHIO
  add("inverse_dynamics/pinocchio", samples, [&e](int k) {
    const State& s = e.states[k];
    pinocchio::rnea(e.pinocchio.model, e.pinocchio.data, s.q, s.dq, s.ddq);
  });
  add("regressor/pinocchio", samples, [&e](int k) {
    const State& s = e.states[k];
    pinocchio::computeJointTorqueRegressor(e.pinocchio.model, e.pinocchio.data, s.q, s.dq, s.ddq);
  });
  add("mass_matrix/pinocchio", samples,
      [&e](int k) { pinocchio::crba(e.pinocchio.model, e.pinocchio.data, e.states[k].q); });
  add("coriolis_matrix/pinocchio", samples, [&e](int k) {
    pinocchio::computeCoriolisMatrix(e.pinocchio.model, e.pinocchio.data, e.states[k].q, e.states[k].dq);
  });
#endif
}

/// Prints as Google Benchmark does, and keeps the time of each repetition [ns a state].
class Collector : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration || run.error_occurred) continue;
      const double seconds = run.real_accumulated_time / static_cast<double>(run.iterations);
      times_[run.run_name.function_name].push_back(1e9 * seconds / samples);
    }
    if (!runs.empty() && runs.front().run_type == Run::RT_Aggregate) ConsoleReporter::ReportRuns(runs);
  }
  std::map<std::string, std::vector<double>>& times() { return times_; }

 private:
  std::map<std::string, std::vector<double>> times_;
};

struct Statistics {
  double median, mean, deviation, worst;
  explicit Statistics(std::vector<double> x) {
    std::sort(x.begin(), x.end());
    const std::size_t half = x.size() / 2;
    median = x.size() % 2 == 1 ? x[half] : 0.5 * (x[half - 1] + x[half]);
    mean = deviation = 0.0;
    for (const double v : x) mean += v / static_cast<double>(x.size());
    for (const double v : x) deviation += (v - mean) * (v - mean) / static_cast<double>(x.size());
    deviation = std::sqrt(deviation);
    worst = x.back();
  }
};

/// How many times as fast as the peer we mean to be.
struct Goal {
  const char *here, *peer;
  double v3, plain;  // 0: none
};
constexpr Goal goals[] = {
    {"inverse_dynamics/dynid", "inverse_dynamics/pinocchio", 5, 4},
    {"inverse_dynamics/dynid", "inverse_dynamics/kdl", 5, 0},
    {"inverse_dynamics_batched/dynid", "inverse_dynamics/pinocchio", 14, 0},
    {"regressor/dynid", "regressor/pinocchio", 5, 4},
    {"mass_matrix/dynid", "mass_matrix/pinocchio", 3, 0},
    {"mass_matrix/dynid", "mass_matrix/kdl", 0, 0},
    {"coriolis_matrix/dynid", "coriolis_matrix/pinocchio", 4, 0},
};

}  // namespace

int main(int argc, char** argv) {
  std::string json_file;
  std::vector<char*> arguments(argv, argv + 1);
  std::string defaults[] = {"--benchmark_repetitions=15", "--benchmark_min_time=0.02",
                            "--benchmark_enable_random_interleaving=true",
                            "--benchmark_report_aggregates_only=true"};
  for (std::string& flag : defaults) arguments.push_back(flag.data());
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--json" && i + 1 < argc)
      json_file = argv[++i];
    else
      arguments.push_back(argv[i]);
  }
  int count = static_cast<int>(arguments.size());
  benchmark::Initialize(&count, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return 2;

  Engines engines(dynid::read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot);
  const double difference = disagreement(engines);
  std::printf("flags %s; engines agree to %.1e over %d states\n", DYNID_BENCH_FLAGS, difference, samples);
  if (!(difference < 1e-10)) {
    std::fprintf(stderr, "the engines disagree: nothing to compare\n");
    return 1;
  }
  register_all(engines);
  Collector collector;
  benchmark::RunSpecifiedBenchmarks(&collector);

  nlohmann::json report = {{"flags", DYNID_BENCH_FLAGS}, {"states", samples}, {"disagreement", difference}};
#ifdef DYNID_WITH_PINOCCHIO
  report["pinocchio"] = PINOCCHIO_VERSION;
#endif
  auto& times = collector.times();
  std::printf("\n%-34s %9s %9s %9s %9s\n", "ns a state", "median", "mean", "+-", "worst");
  for (const auto& [name, x] : times) {
    const Statistics s(x);
    std::printf("%-34s %9.1f %9.1f %9.1f %9.1f\n", name.c_str(), s.median, s.mean, s.deviation, s.worst);
    report["ns"][name] = {
        {"median", s.median}, {"mean", s.mean}, {"deviation", s.deviation}, {"worst", s.worst}};
  }
  std::printf("\n%-34s %-28s %9s %9s\n", "times as fast as the peer", "", "median", "goal");
  const bool v3 = std::string(DYNID_BENCH_FLAGS) != "-O3";
  for (const Goal& goal : goals) {
    if (times.count(goal.here) == 0 || times.count(goal.peer) == 0) continue;
    const double ratio = Statistics(times[goal.peer]).median / Statistics(times[goal.here]).median;
    const double wanted = v3 ? goal.v3 : goal.plain;
    std::printf("%-34s %-28s %9.2f %9s%s\n", goal.here, goal.peer, ratio,
                wanted > 0 ? std::to_string(static_cast<int>(wanted)).c_str() : "",
                wanted > 0 && ratio < wanted ? "  missed" : "");
    nlohmann::json entry = {{"here", goal.here}, {"peer", goal.peer}, {"ratio", ratio}};
    if (wanted > 0) entry["goal"] = wanted;
    report["ratios"].push_back(entry);
  }
  if (!json_file.empty()) {
    std::ofstream out(json_file);
    out << report.dump(2) << "\n";
    if (!out.flush()) {
      std::fprintf(stderr, "%s: cannot be written\n", json_file.c_str());
      return 2;
    }
  }
  return 0;
}
