// SPDX-License-Identifier: Apache-2.0
//
// A 1 kHz loop in the manner of libfranka that feels who pushes the arm. Needs dynid::core alone: the model
// is the header that `dynid export --model config/panda.yaml --format header --out panda_model.hpp` wrote.
#include <array>
#include <cstdio>
#include <dynid/estimation/torque_estimator.hpp>

#include "panda_model.hpp"

using Vector7 = Eigen::Matrix<double, 7, 1>;

struct RobotState {
  std::array<double, 7> q, dq, tau_J;
};

// In place of franka::Robot::read(): an arm at rest, pushed from 0.5 s to 1 s; calls back every millisecond.
template <class Callback>
void read(const Vector7& holding_torque, const Callback& callback) {
  RobotState state = {{0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785}, {}, {}};
  for (int k = 0; k < 1500; ++k) {
    state.q[6] = 0.785 + 1e-6 * (k % 2);  // an encoder is never quite still
    for (int i = 0; i < 7; ++i) state.tau_J[i] = holding_torque[i];
    if (k >= 500 && k < 1000) state.tau_J[0] -= 5.0;  // a push of +5 N m takes as much off the motor
    callback(state, 0.001);
  }
}

int main() try {
  const auto robot = panda_model::make_robot<dynid::Robot>();
  dynid::TorqueEstimator<7> estimator(robot);  // set-up: may throw
  Vector7 q, holding;
  q << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
  holding = estimator.step(0.0, q, Vector7::Zero(), Vector7::Zero()).tau_model;
  estimator.reset();

  double time = 0.0;
  bool touched = false;
  read(holding, [&](const RobotState& state, double dt) noexcept {
    using Map = Eigen::Map<const Vector7>;
    // step() neither allocates nor locks nor throws; a real loop would leave the printing to another thread.
    const auto& now = estimator.step(dt, Map(state.q.data()), Map(state.dq.data()), Map(state.tau_J.data()));
    // Positive where the environment pushes; Franka's tau_ext_hat_filtered has the other sign.
    if (now.contact.any() != touched) {
      touched = !touched;
      std::printf("%.3f s: %s, %5.2f N m on joint 1\n", time, touched ? "pushed" : "free", now.residual[0]);
    }
    time += dt;
  });
  return touched ? 1 : 0;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
