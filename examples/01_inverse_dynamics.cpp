// SPDX-License-Identifier: Apache-2.0
//
// Reads a seven-joint model and prints the torques of one state. Usage: 01_inverse_dynamics config/panda.yaml
#include <cstdio>
#include <dynid/dynamics/inverse_dynamics.hpp>
#include <dynid/model/yaml.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) throw dynid::Error("usage: 01_inverse_dynamics MODEL.yaml");
  const dynid::Robot robot = dynid::read_model(argv[1]).robot;
  const dynid::Model<7> model(robot);    // immutable: share it between threads
  dynid::Workspace<7> workspace(model);  // scratch: one for each thread

  Eigen::Matrix<double, 7, 1> q, dq, ddq, tau;
  q << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;  // [rad]
  dq << 0.1, 0.2, -0.1, 0.3, 0.0, -0.2, 0.1;         // [rad/s]
  ddq.setZero();                                     // [rad/s^2]
  dynid::inverse_dynamics(model, workspace, q, dq, ddq, tau);

  for (int i = 0; i < model.size(); ++i) {
    std::printf("%-14s %9.4f N m\n", robot.joints[i].name.c_str(), tau[i]);
  }
  return 0;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
