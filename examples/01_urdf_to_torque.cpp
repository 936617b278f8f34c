// SPDX-License-Identifier: Apache-2.0
//
// Reads an arm and prints the torques of one state. Usage: 01_urdf_to_torque ARM.urdf (an MJCF or a model
// file will do as well). Any number of joints: where it is known, Model<7> and its like are quicker.
#include <cstdio>
#include <dynid/dynamics/inverse_dynamics.hpp>
#include <dynid/model/robot_file.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) throw dynid::Error("usage: 01_urdf_to_torque ARM.urdf");
  const dynid::Robot robot = dynid::read_robot(argv[1]);  // throws Error, with file, line and what is wrong
  const dynid::Model<> model(robot);                      // immutable: share it between threads
  dynid::Workspace<> workspace(model);                    // scratch: one for each thread

  const int n = model.size();
  const Eigen::VectorXd q = Eigen::VectorXd::LinSpaced(n, 0.1, 0.8);  // [rad], base to tip
  const Eigen::VectorXd dq = Eigen::VectorXd::Constant(n, 0.2);       // [rad/s]
  const Eigen::VectorXd ddq = Eigen::VectorXd::Zero(n);               // [rad/s^2]
  Eigen::VectorXd tau(n);
  dynid::inverse_dynamics(model, workspace, q, dq, ddq, tau);  // [N m], noexcept, no allocation

  for (int i = 0; i < n; ++i) {
    const dynid::Joint& joint = robot.joints[i];
    // The kernel is the rigid body's; friction is a law of the joint.
    std::printf("%-14s %9.4f N m, friction %7.4f N m\n", joint.name.c_str(), tau[i],
                joint.friction.torque(dq[i]));
  }
  return tau.allFinite() ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
