// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/uncertainty.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "dynid/base/error.hpp"

namespace dynid {
namespace {

void not_negative(double x, const std::string& what) {
  if (!(x >= 0.0) || !std::isfinite(x)) throw Error("uncertainty: " + what + " must not be negative");
}
void positive(double x, const std::string& what) {
  if (!(x > 0.0) || !std::isfinite(x)) throw Error("uncertainty: " + what + " must be positive");
}

}  // namespace

double ContactWindow::threshold(double rate) const {
  return level + scale * std::max(0.0, std::log(per_hour / rate));
}

void validate(const Uncertainty& uncertainty, int joints) {
  if (static_cast<int>(uncertainty.joints.size()) != joints)
    throw Error("uncertainty: " + std::to_string(uncertainty.joints.size()) + " joints for a robot of " +
                std::to_string(joints));
  for (std::size_t i = 0; i < uncertainty.joints.size(); ++i) {
    const JointUncertainty& u = uncertainty.joints[i];
    const std::string joint = "joint " + std::to_string(i + 1) + ": ";
    not_negative(u.constant, joint + "constant");
    not_negative(u.speed, joint + "speed");
    not_negative(u.stiction, joint + "stiction");
    not_negative(u.load, joint + "load");
    not_negative(u.acceleration, joint + "acceleration");
    not_negative(u.momentum_noise, joint + "momentum_noise");
    not_negative(u.sticking, joint + "sticking");
    positive(u.stiction_speed, joint + "stiction_speed");
    positive(u.correlation_time, joint + "correlation_time");
    positive(u.constant + u.momentum_noise, joint + "the sum of constant and momentum_noise");
    if (!u.contact_point.allFinite()) throw Error("uncertainty: " + joint + "contact_point is not finite");
  }
  if (uncertainty.windows.empty() || uncertainty.windows.size() > Uncertainty::most_windows)
    throw Error("uncertainty: 1 to " + std::to_string(Uncertainty::most_windows) + " windows needed, not " +
                std::to_string(uncertainty.windows.size()));
  for (std::size_t b = 0; b < uncertainty.windows.size(); ++b) {
    const ContactWindow& w = uncertainty.windows[b];
    const std::string window = "window " + std::to_string(b + 1) + ": ";
    positive(w.bandwidth, window + "bandwidth");
    positive(w.level, window + "level");
    positive(w.scale, window + "scale");
    positive(w.per_hour, window + "per_hour");
  }
  not_negative(uncertainty.seconds, "seconds");
}

}  // namespace dynid
