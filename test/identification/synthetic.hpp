// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <random>
#include <string>

#include "dynid/identification/predict.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/signal/log.hpp"

namespace dynid::test {

inline Robot panda() { return read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot; }

/// A motion of five harmonics a joint, exactly differentiated, the robot's own torques and white noise on
/// them [N m]: what the fit should get back.
inline Log synthetic_log(const Robot& robot, unsigned seed, double duration = 20.0, double rate = 250.0,
                         double noise = 0.0) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto n = static_cast<Eigen::Index>(duration * rate);
  const int joints = robot.size();
  Eigen::MatrixXd q(n, joints), dq(n, joints), ddq(n, joints);
  for (int j = 0; j < joints; ++j) {
    double a[5], b[5];
    for (int k = 0; k < 5; ++k) {
      a[k] = 0.35 * normal(random);
      b[k] = 0.35 * normal(random);
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const double t = double(i) / rate;
      double x = 0.3 * j, v = 0.0, c = 0.0;
      for (int k = 0; k < 5; ++k) {
        const double w = 0.15 * M_PI * (k + 1) * 2.0;
        x += (a[k] * std::sin(w * t) - b[k] * std::cos(w * t)) / w;
        v += a[k] * std::cos(w * t) + b[k] * std::sin(w * t);
        c += w * (b[k] * std::cos(w * t) - a[k] * std::sin(w * t));
      }
      q(i, j) = x;
      dq(i, j) = v;
      ddq(i, j) = c;
    }
  }
  Log log;
  log.source = "synthetic " + std::to_string(seed);
  log.t = Eigen::VectorXd::LinSpaced(n, 0.0, double(n - 1) / rate);
  log.q = q;
  log.dq = dq;
  log.tau = predict_torque(robot, q, dq, ddq).tau;
  for (double& x : log.tau.reshaped()) x += noise * normal(random);
  return log;
}

/// eq. (24) on every joint, a little different on each.
inline Robot with_linear_friction(Robot robot) {
  for (int j = 0; j < robot.size(); ++j)
    robot.joints[static_cast<std::size_t>(j)].friction = {
        {0.2 + 0.05 * j, 0.3 - 0.02 * j, 0.1 * (j - 3), 0.02}, {}};
  return robot;
}

}  // namespace dynid::test
