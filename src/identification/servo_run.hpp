// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "servo_data.hpp"

namespace dynid::detail {

constexpr double huber_constant = 1.345;  ///< standard deviations: 95 % efficiency on normal noise

inline double huber(double r, double width) {
  const double z = std::abs(r);
  return z <= width ? 0.5 * z * z : width * (z - 0.5 * width);
}

/// Runs the open loop along a series, `substeps` steps an interval, and calls visit(i, state) at every stamp
/// from the second on. The rigid body's inertia and torque are those along the measured motion.
template <bool sensitive, class Visit>
void run_servo(const ServoJoint& joint, const ServoSeries& s, int substeps, Visit&& visit) {
  Eigen::Index hint = 0;
  ServoState<sensitive> state(s.q[0], s.v0, s.command.at(s.t[0] - joint.delay, hint));
  const bool body = s.load.size() > 0;
  ServoInput in;
  for (Eigen::Index i = 0; i + 1 < s.t.size(); ++i) {
    const double span = s.t[i + 1] - s.t[i];
    const int steps = std::max(1, static_cast<int>(std::lround(substeps * span / s.interval)));
    const double h = span / steps;
    if (span > 0.0)
      for (int k = 0; k < steps; ++k) {
        s.command.fill(s.t[i] + k * h, h, joint.delay, hint, in);
        if (body) {
          const double x = (k + 0.5) / steps;
          in.inertia = s.inertia[i] + x * (s.inertia[i + 1] - s.inertia[i]);
          in.load = s.load[i] + x * (s.load[i + 1] - s.load[i]);
          in.gravity = s.gravity[i] + x * (s.gravity[i + 1] - s.gravity[i]);
        }
        state.step(joint, in);
      }
    visit(i + 1, state);
  }
}

}  // namespace dynid::detail
