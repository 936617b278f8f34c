// SPDX-License-Identifier: Apache-2.0
#include "engines.hpp"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <memory>
#include <random>
#include <vector>

#ifdef DYNID_WITH_PINOCCHIO
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/config.hpp>
#if PINOCCHIO_VERSION_AT_LEAST(4, 0, 0)
#include <pinocchio/multibody.hpp>
#else
#include <pinocchio/multibody/data.hpp>
#include <pinocchio/multibody/joint/joint-mimic.hpp>
#include <pinocchio/multibody/model.hpp>
#endif
#endif

#include "dynid/dynamics/dynamics.hpp"
#include "dynid/model/kdl.hpp"

namespace {

constexpr int n = 7;
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
/// The joints that an arm of revolute joints needs. Pinocchio's own collection has some twenty-five, which
/// take minutes and gigabytes to compile and are no faster.
template <class S, int options>
struct RevoluteJoints {
  using Scalar = S;
  enum { Options = options };
  using Z = pinocchio::JointModelRevoluteTpl<Scalar, Options, 2>;
  using Any = pinocchio::JointModelRevoluteUnalignedTpl<Scalar, Options>;
  using Mimic =
      pinocchio::JointModelMimicTpl<Scalar, Options, RevoluteJoints>;  // Pinocchio asks for it by name
  using MimicData = pinocchio::JointDataMimicTpl<Scalar, Options, RevoluteJoints>;
  using JointModelVariant = boost::variant<Z, Any, boost::recursive_wrapper<Mimic>>;
  using JointDataVariant = boost::variant<pinocchio::JointDataRevoluteTpl<Scalar, Options, 2>,
                                          pinocchio::JointDataRevoluteUnalignedTpl<Scalar, Options>,
                                          boost::recursive_wrapper<MimicData>>;
};

struct Pinocchio {
  explicit Pinocchio(const dynid::Robot& robot) {
    pinocchio::JointIndex parent = 0;
    for (const dynid::Joint& joint : robot.joints) {
      const pinocchio::SE3 origin(joint.origin.linear(), joint.origin.translation());
      const bool about_z = joint.axis == Eigen::Vector3d::UnitZ();
      if (about_z)  // the fastest kind that Pinocchio has
        parent = model.addJoint(parent, RevoluteJoints<double, 0>::Z(), origin, joint.name);
      else
        parent = model.addJoint(parent, RevoluteJoints<double, 0>::Any(joint.axis), origin, joint.name);
      const dynid::LinkInertia link = dynid::from_standard(joint.parameters);
      model.appendBodyToJoint(parent, pinocchio::Inertia(link.mass, link.com, link.inertia));
    }
    model.gravity.linear(robot.gravity);
    data = pinocchio::DataTpl<double, 0, RevoluteJoints>(model);
  }
  pinocchio::ModelTpl<double, 0, RevoluteJoints> model;
  pinocchio::DataTpl<double, 0, RevoluteJoints> data;
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

}  // namespace

double register_benchmarks(const dynid::Robot& robot) {
  static std::unique_ptr<Engines> engines;
  engines = std::make_unique<Engines>(robot);
  register_all(*engines);
  return disagreement(*engines);
}

const char* pinocchio_version() {
#ifdef DYNID_WITH_PINOCCHIO
  return PINOCCHIO_VERSION;
#else
  return nullptr;
#endif
}
