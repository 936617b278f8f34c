// SPDX-License-Identifier: Apache-2.0
//
// Eight samples at once: every kernel also takes a Packet8 for its scalar. For work on logs, not for a loop.
// Needs dynid::core alone.
#include <cmath>
#include <cstdio>
#include <dynid/dynamics/inverse_dynamics.hpp>
#include <dynid/dynamics/packet.hpp>

#include "panda_model.hpp"

int main() try {
  using dynid::Packet8;
  const auto robot = panda_model::make_robot<dynid::Robot>();
  const dynid::Model<7> model(robot);  // one model for both
  dynid::Workspace<7> one(model);
  dynid::Workspace<7, Packet8> eight(model);

  constexpr int samples = 1000;  // a motion of one second
  const auto motion = [](int k, int j) { return std::sin(0.001 * k * (j + 1) + j); };
  double torque = 0.0, worst = 0.0;
  for (int first = 0; first < samples; first += 8) {
    Eigen::Matrix<Packet8, 7, 1> q, dq, ddq, tau;  // joint j of sample first + k is q[j][k]
    for (int j = 0; j < 7; ++j)
      for (int k = 0; k < 8; ++k) {
        const double x = motion(first + k, j), v = j + 1;
        q[j][k] = x;
        dq[j][k] = v * std::sqrt(1.0 - x * x);
        ddq[j][k] = -v * v * x;
      }
    dynid::inverse_dynamics(model, eight, q, dq, ddq, tau);

    for (int k = 0; k < 8; ++k) {  // the same, one by one
      Eigen::Matrix<double, 7, 1> q1, dq1, ddq1, tau1;
      for (int j = 0; j < 7; ++j) q1[j] = q[j][k], dq1[j] = dq[j][k], ddq1[j] = ddq[j][k];
      dynid::inverse_dynamics(model, one, q1, dq1, ddq1, tau1);
      for (int j = 0; j < 7; ++j) {
        torque = std::max(torque, std::abs(tau1[j]));
        worst = std::max(worst, std::abs(tau1[j] - tau[j][k]));
      }
    }
  }
  std::printf("%d samples in %d packets; torques up to %.1f N m, largest difference to one by one %.1e N m\n",
              samples, samples / 8, torque, worst);
  return worst < 1e-9 * torque ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
