// SPDX-License-Identifier: Apache-2.0
//
// How long a cycle of TorqueEstimator takes on the published Panda: model torque, friction, both external
// torques, wrench and contact, along a motion with an acceleration estimated from dq.
//
//   dynid_bench_estimation [CYCLES]        back to back; 10^7 by default
//   dynid_bench_estimation --rate SECONDS  at 1 kHz, sleeping in between (run it beside a load)
//
// Percentiles count every cycle; the clock is read twice a cycle and its own time is not taken off. A line
// about a loop of the same length that touches no memory shows what the machine itself takes away. At 1 kHz
// the time on the processor (CLOCK_THREAD_CPUTIME_ID) is shown beside the time on the wall.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <thread>
#include <vector>

#include "dynid/estimation/torque_estimator.hpp"
#include "dynid/model/yaml.hpp"

namespace {

using Vector7 = Eigen::Matrix<double, 7, 1>;
using Clock = std::chrono::steady_clock;

struct Sample {
  Vector7 q, dq, tau;
};

// A few seconds of sines about the middle of the joints' ranges, with the torques that go with them.
std::vector<Sample> motion(const dynid::Robot& robot) {
  const dynid::TorqueModel<7> model(robot);
  dynid::Workspace<7> ws(model.rigid_body());
  std::vector<Sample> samples(4096);
  Vector7 ddq, tau_f;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    Sample& s = samples[k];
    for (int i = 0; i < 7; ++i) {
      const auto& limits = robot.joints[i].limits;
      const double w = 2.0 * M_PI * (1 + i % 3) / 4.096, t = 1e-3 * double(k), a = 0.3;
      s.q[i] = 0.5 * (limits.lower + limits.upper) + a * std::sin(w * t + i);
      s.dq[i] = a * w * std::cos(w * t + i);
      ddq[i] = -a * w * w * std::sin(w * t + i);
    }
    model.friction(s.q, s.dq, tau_f);
    model.torque(ws, s.q, s.dq, ddq, tau_f, s.tau);
  }
  return samples;
}

/// An uncertainty with every term, whose threshold the motion never passes, or always.
dynid::Uncertainty uncertainty(const dynid::Robot& robot, bool contact) {
  dynid::Uncertainty u;
  dynid::JointUncertainty joint;
  joint.constant = joint.stiction = 0.01, joint.speed = joint.load = joint.acceleration = 1e-4;
  joint.sticking = 0.3;
  const auto n = static_cast<Eigen::Index>(robot.joints.size());
  u.joints.assign(robot.joints.size(), joint);
  u.correlation = Eigen::MatrixXd::Constant(n, n, 0.3);
  u.correlation.diagonal().setOnes();
  u.period = 1e-3;
  const double level = contact ? 1e-12 : 1e12;
  u.tail = {level, level, 1.0};
  return u;
}

/// Durations, every one counted.
class Durations {
 public:
  void add(long ns) {
    worst_ = std::max(worst_, ns);
    ++counts_[std::size_t(std::min<long>(ns, long(counts_.size()) - 1))];
    ++total_;
  }
  long share(double part) const {  // [ns] that this part of them stays within
    double seen = 0.0;
    for (std::size_t ns = 0; ns < counts_.size(); ++ns)
      if ((seen += double(counts_[ns])) >= part * double(total_)) return long(ns);
    return worst_;
  }
  void print(const char* what) const {
    std::printf("%-28s %ld cycles: median %ld ns, 99 %% %ld ns, 99.99 %% %ld ns, worst %.1f us\n", what,
                total_, share(0.5), share(0.99), share(0.9999), double(worst_) * 1e-3);
  }

 private:
  std::vector<long> counts_ = std::vector<long>(1'000'000, 0);
  long total_ = 0, worst_ = 0;
};

template <class F>
long timed(const F& f) {
  const auto begin = Clock::now();
  f();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - begin).count();
}

long processor_time() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return t.tv_sec * 1'000'000'000L + t.tv_nsec;
}

}  // namespace

int main(int argc, char** argv) try {
  const bool at_rate = argc > 2 && std::strcmp(argv[1], "--rate") == 0;
  const long cycles = at_rate ? std::lround(1000.0 * std::atof(argv[2]))
                              : (argc > 1 ? std::lround(std::atof(argv[1])) : 10'000'000);
  if (cycles < 1) throw dynid::Error("usage: dynid_bench_estimation [CYCLES | --rate SECONDS]");
  const dynid::Robot robot = dynid::read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot;
  const std::vector<Sample> samples = motion(robot);

  enum class Mode { first, second, test, contact };
  for (const Mode mode : {Mode::first, Mode::second, Mode::test, Mode::contact}) {
    if (at_rate && mode == Mode::second) continue;
    const dynid::ObserverOrder order =
        mode == Mode::second ? dynid::ObserverOrder::second : dynid::ObserverOrder::first;
    dynid::TorqueEstimatorOptions options;
    options.order = order;
    if (mode == Mode::test || mode == Mode::contact)
      options.uncertainty = uncertainty(robot, mode == Mode::contact);
    dynid::TorqueEstimator<7> estimator(robot, options);
    Durations wall, processor, control;
    double sum = 0.0;  // so that nothing is optimised away
    auto next = Clock::now();
    for (long k = 0; k < cycles; ++k) {
      const Sample& s = samples[std::size_t(k) % samples.size()];
      const auto step = [&] {
        const auto& estimate = estimator.step(1e-3, s.q, s.dq, s.tau);
        sum += estimate.residual[0] + estimate.wrench[0] + estimate.pushed.wrench[0];
      };
      if (!at_rate) {
        wall.add(timed(step));
        continue;
      }
      std::this_thread::sleep_until(next += std::chrono::milliseconds(1));
      const long begin = processor_time();
      wall.add(timed(step));
      processor.add(processor_time() - begin);
    }
    const std::string what = mode == Mode::first    ? "first order"
                             : mode == Mode::second ? "second order"
                             : mode == Mode::test   ? "with contact test"
                                                    : "test, in contact";
    wall.print((what + (at_rate ? ", 1 kHz, wall" : "")).c_str());
    if (at_rate) {
      processor.print((what + ", 1 kHz, processor").c_str());
    } else {
      const auto spin = [&](long turns) {
        for (long i = 0; i < turns; ++i) sum = sum * 0.999 + 1e-3;
      };
      long turns = 16;
      while (timed([&] { spin(turns); }) < wall.share(0.5)) ++turns;
      for (long k = 0; k < cycles; ++k) control.add(timed([&] { spin(turns); }));
      control.print("no memory touched");
    }
    if (!std::isfinite(sum)) return 1;
  }
  return 0;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
