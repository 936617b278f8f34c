// SPDX-License-Identifier: Apache-2.0
//
// The estimator takes another model while its loop runs: the arm has picked something up, and a second thread
// says so. Needs dynid::core alone; the model is the header that `dynid export --format header` wrote.
#include <atomic>
#include <cstdio>
#include <dynid/estimation/torque_estimator.hpp>
#include <thread>

#include "panda_model.hpp"

using Vector7 = Eigen::Matrix<double, 7, 1>;

int main() try {
  const auto robot = panda_model::make_robot<dynid::Robot>();
  dynid::LinkInertia picked_up;  // in the tip frame
  picked_up.mass = 1.2;          // [kg]
  picked_up.com << 0.0, 0.0, 0.08;
  picked_up.inertia = 2e-3 * Eigen::Matrix3d::Identity();

  // The robot, in place of a real one: it holds the load still.
  Vector7 q;
  q << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
  dynid::TorqueModel<7> loaded(robot);
  loaded.set_payload(picked_up);
  dynid::TorqueEstimator<7> truth(loaded);
  const Vector7 tau = truth.step(0.0, q, Vector7::Zero(), Vector7::Zero()).tau_model;

  dynid::TorqueEstimator<7> estimator(robot);  // does not know of the load
  std::atomic<int> cycle{0};
  std::thread planner([&] {  // any thread but the loop's: it may allocate, lock and throw
    while (cycle < 500) std::this_thread::yield();
    dynid::TorqueModel<7> next(robot);
    next.set_payload(picked_up);
    estimator.adopt(next);  // wait-free for the loop
  });

  double before = 0.0, after = 0.0, jump = 0.0, last = 0.0;
  int swapped = -1;
  for (int k = 0; swapped < 0 || k < swapped + 500; ++k) {  // a real loop waits for its robot here
    q[6] = 0.785 + 1e-6 * (k % 2);                          // an encoder is never quite still
    const auto& now = estimator.step(0.001, q, Vector7::Zero(), tau);
    if (dynid::has(now.status, dynid::Status::model_changed)) {
      swapped = k;
      before = last;
      jump = std::abs(now.residual[1] - last);
    }
    after = last = now.residual[1];
    cycle = k;
  }
  planner.join();
  std::printf(
      "residual of joint 2: %.2f N m with the old model, %.3f N m half a second after the change,\n"
      "which itself moved it by %.3f N m\n",
      before, after, jump);
  return std::abs(before) > 3.0 && std::abs(after) < 0.05 && jump < 1.0 ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
