// SPDX-License-Identifier: Apache-2.0
//
// A joint that takes commanded positions and shows no torque: its servo from commands and positions alone.
#include <cmath>
#include <cstdio>
#include <dynid/identification/servo.hpp>

/// A pendulum of 0.3 kg on a servo.
dynid::Robot arm() {
  dynid::Robot robot;
  robot.name = "pendulum";
  robot.joints = {dynid::make_joint("shoulder", dynid::JointType::revolute, {0.0, -M_PI / 2, 0.0, 0.0})};
  dynid::Joint& joint = robot.joints[0];
  dynid::LinkInertia body;
  body.mass = 0.3;
  body.com << 0.15, 0.0, 0.0;
  body.inertia = 1e-3 * Eigen::Matrix3d::Identity();
  joint.parameters = dynid::to_standard(body);
  joint.rotor_inertia = 0.01;
  return robot;
}

int main() try {
  dynid::Robot truth = arm();
  truth.joints[0].friction.linear.coulomb = 0.05;  // [N m]
  truth.joints[0].servo = dynid::Servo{};
  truth.joints[0].servo->kp = 12.0;     // [N m/rad]
  truth.joints[0].servo->kd = 0.4;      // [N m s/rad]
  truth.joints[0].servo->delay = 0.03;  // [s]

  // 30 s at 50 Hz, in place of a recording: t, u and q are all that is needed.
  dynid::Log log;
  log.source = "made";
  const int rows = 1500;
  log.t = 0.02 * Eigen::VectorXd::LinSpaced(rows, 0.0, rows - 1.0);
  log.u.resize(rows, 1);
  for (int k = 0; k < rows; ++k) {
    const double t = log.t[k];
    log.u(k, 0) = 0.5 * std::sin(1.1 * t + 0.03 * t * t) + (std::fmod(t, 5.0) < 2.5 ? 0.3 : -0.3);
  }
  log.q = Eigen::MatrixXd::Constant(rows, 1, log.u(0, 0));
  log.q = dynid::replay_servos(truth, log).q;  // open loop, from the first position

  const dynid::ServoIdentification found = dynid::identify_servos({log}, arm());
  const dynid::ServoFit& joint = found.joints[0];
  std::printf("%s: %s; open-loop error on what was left out %.3f mrad\n", joint.name.c_str(),
              joint.si ? "in SI, since gravity shows the stiffness" : "ratios only", 1e3 * joint.held_out);
  for (const dynid::ServoValue& v : joint.values)
    std::printf("  %-14s %9.4f [%.4f, %.4f] %s\n", v.name.c_str(), v.value, v.low, v.high, v.unit.c_str());
  return joint.si && std::abs(found.robot.joints[0].servo->kp - 12.0) < 0.6 ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
