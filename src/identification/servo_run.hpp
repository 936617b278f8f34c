// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "servo_data.hpp"

namespace dynid::detail {

constexpr double huber_constant = 1.345;  ///< standard deviations: 95 % efficiency on normal noise

inline double huber(double r, double width) {
  const double z = std::abs(r);
  return z <= width ? 0.5 * z * z : width * (z - 0.5 * width);
}

/// Runs the open loop along a series, `substeps` steps an interval, and calls visit(i, state) at every stamp
/// from the second on. The rigid body's inertia and torque are those along the measured motion; `factors`
/// times the series' load parts are added.
template <bool sensitive, int parts = 0, class Visit>
void run_servo(const ServoJoint& joint, const ServoSeries& s, int substeps, Visit&& visit,
               const double* factors = nullptr) {
  Eigen::Index hint = 0;
  ServoState<sensitive, parts> state(s.q[0], s.v0, s.command.at(s.t[0] - joint.delay, hint));
  const bool body = s.load.size() > 0;
  ServoInput in;
  std::array<double, parts> part{};
  const bool in_parts = parts > 0 && body && s.parts.rows() > 0;
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
          if constexpr (parts > 0)
            if (in_parts)
              for (std::size_t m = 0; m < part.size(); ++m) {
                const auto c = static_cast<Eigen::Index>(m);
                part[m] = s.parts(i, c) + x * (s.parts(i + 1, c) - s.parts(i, c));
                in.load += factors[m] * part[m];
              }
        }
        state.step(joint, in, part.data());
      }
    visit(i + 1, state);
  }
}

}  // namespace dynid::detail
