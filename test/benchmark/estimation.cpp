// SPDX-License-Identifier: Apache-2.0
//
// How long a cycle of TorqueEstimator takes on the published Panda: model torque, friction, both external
// torques, wrench and contact, along a motion with an acceleration estimated from dq.
//
//   dynid_bench_estimation [CYCLES]        back to back; 10^7 by default
//   dynid_bench_estimation --rate SECONDS  at 1 kHz, sleeping in between (run it beside a load)
//
// Percentiles count every cycle; the clock is read twice a cycle and its own time is not taken off.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
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

void report(const std::vector<long>& histogram, long cycles, long worst) {
  long seen = 0, median = -1, p99 = -1, p9999 = -1;
  for (std::size_t ns = 0; ns < histogram.size(); ++ns) {
    seen += histogram[ns];
    if (median < 0 && 2 * seen >= cycles) median = long(ns);
    if (p99 < 0 && double(seen) >= 0.99 * double(cycles)) p99 = long(ns);
    if (p9999 < 0 && double(seen) >= 0.9999 * double(cycles)) p9999 = long(ns);
  }
  std::printf("%ld cycles: median %ld ns, 99 %% %ld ns, 99.99 %% %ld ns, worst %.1f us\n", cycles, median,
              p99, p9999, double(worst) * 1e-3);
}

}  // namespace

int main(int argc, char** argv) try {
  const bool at_rate = argc > 2 && std::strcmp(argv[1], "--rate") == 0;
  const long cycles = at_rate ? std::lround(1000.0 * std::atof(argv[2]))
                              : (argc > 1 ? std::lround(std::atof(argv[1])) : 10'000'000);
  if (cycles < 1) throw dynid::Error("usage: dynid_bench_estimation [CYCLES | --rate SECONDS]");
  const dynid::Robot robot = dynid::read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot;
  const std::vector<Sample> samples = motion(robot);

  for (const dynid::ObserverOrder order : {dynid::ObserverOrder::first, dynid::ObserverOrder::second}) {
    if (at_rate && order == dynid::ObserverOrder::second) break;
    dynid::TorqueEstimatorOptions options;
    options.order = order;
    dynid::TorqueEstimator<7> estimator(robot, options);
    std::vector<long> histogram(1'000'000, 0);
    long worst = 0;
    double sum = 0.0;  // so that nothing is optimised away
    auto next = Clock::now();
    for (long k = 0; k < cycles; ++k) {
      const Sample& s = samples[std::size_t(k) % samples.size()];
      if (at_rate) std::this_thread::sleep_until(next += std::chrono::milliseconds(1));
      const auto begin = Clock::now();
      const auto& estimate = estimator.step(1e-3, s.q, s.dq, s.tau);
      const auto end = Clock::now();
      sum += estimate.residual[0] + estimate.wrench[0];
      const long ns = std::chrono::duration_cast<std::chrono::nanoseconds>(end - begin).count();
      worst = std::max(worst, ns);
      ++histogram[std::size_t(std::min<long>(ns, long(histogram.size()) - 1))];
    }
    std::printf("%s order%s: ", order == dynid::ObserverOrder::first ? "first" : "second",
                at_rate ? " at 1 kHz" : "");
    report(histogram, cycles, worst);
    if (!std::isfinite(sum)) return 1;
  }
  return 0;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
