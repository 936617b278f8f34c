// SPDX-License-Identifier: Apache-2.0
//
// Section IV-A of the letter: the coefficients behind a controller's numbers M(q) and g(q). Usage: 03_reverse
// MODEL. In place of a controller, this program's own kernels answer.
#include <cstdio>
#include <dynid/dynamics/gravity.hpp>
#include <dynid/dynamics/mass_matrix.hpp>
#include <dynid/identification/reverse.hpp>
#include <dynid/model/robot_file.hpp>
#include <random>

/// 300 configurations within the limits, M's lower triangle row by row, then g.
dynid::ModelSamples ask_controller(const dynid::Robot& robot) {
  const int n = robot.size(), rows = 300, entries = n * (n + 1) / 2;
  const dynid::Model<> model(robot);
  dynid::Workspace<> workspace(model);
  dynid::ModelSamples samples;
  samples.source = "the controller";
  samples.q.resize(rows, n);
  samples.s.resize(rows, entries + n);
  std::mt19937_64 random(1);
  for (int k = 0; k < rows; ++k) {
    Eigen::VectorXd q(n), g(n);
    for (int j = 0; j < n; ++j) {
      const dynid::JointLimits& limits = robot.joints[j].limits;
      q[j] = std::uniform_real_distribution<double>(limits.lower, limits.upper)(random);
    }
    Eigen::MatrixXd M(n, n);
    dynid::mass_matrix(model, workspace, q, M);
    dynid::gravity(model, workspace, q, g);
    samples.q.row(k) = q.transpose();
    for (int i = 0, at = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) samples.s(k, at++) = M(i, j);
    samples.s.row(k).tail(n) = g.transpose();
  }
  return samples;
}

int main(int argc, char** argv) try {
  if (argc != 2) throw dynid::Error("usage: 03_reverse MODEL");
  const dynid::Robot controller = dynid::read_robot(argv[1]);
  const dynid::ModelSamples samples = ask_controller(controller);

  dynid::Robot kinematics = controller;
  kinematics.set_parameters(Eigen::VectorXd::Zero(10 * controller.size()));
  const dynid::ReverseIdentification found = dynid::reverse_engineer(kinematics, samples);
  std::printf("%d coefficients, condition number %.2f, relative error %.1e %%\n", found.rank,
              found.condition_number, found.relative_error_percent);
  const Eigen::VectorXd exact = found.base.K * controller.parameters();
  for (int k = 0; k < 5; ++k)
    std::printf("  %-4s %9.5f (the controller's: %9.5f)  %s\n", found.coefficients[k].name.c_str(),
                found.values[k], exact[k], found.coefficients[k].expression.c_str());
  return found.relative_error_percent < 1e-6 ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
