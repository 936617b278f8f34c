// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/uncertainty.hpp"

#include <Eigen/Cholesky>
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

double ContactTail::threshold(double rate) const {
  return level + scale * std::max(0.0, std::log(per_hour / rate));
}

void validate(const Uncertainty& uncertainty, int joints) {
  if (static_cast<int>(uncertainty.joints.size()) != joints)
    throw Error("uncertainty: " + std::to_string(uncertainty.joints.size()) + " joints for a robot of " +
                std::to_string(joints));
  for (std::size_t i = 0; i < uncertainty.joints.size(); ++i) {
    const JointUncertainty& u = uncertainty.joints[i];
    const std::string joint = "joint " + std::to_string(i + 1) + ": ";
    positive(u.constant, joint + "constant");
    not_negative(u.speed, joint + "speed");
    not_negative(u.stiction, joint + "stiction");
    not_negative(u.load, joint + "load");
    not_negative(u.acceleration, joint + "acceleration");
    not_negative(u.sticking, joint + "sticking");
    positive(u.stiction_speed, joint + "stiction_speed");
    positive(u.extent, joint + "extent");
    if (!u.contact_point.allFinite()) throw Error("uncertainty: " + joint + "contact_point is not finite");
  }
  const Eigen::MatrixXd& C = uncertainty.correlation;
  if (C.rows() != joints || C.cols() != joints || !C.allFinite() || C != C.transpose() ||
      (C.diagonal().array() != 1.0).any() || C.llt().info() != Eigen::Success)
    throw Error("uncertainty: correlation is not a correlation matrix of " + std::to_string(joints) +
                " joints");
  positive(uncertainty.window, "window");
  positive(uncertainty.motion_bandwidth, "motion_bandwidth");
  not_negative(uncertainty.period, "period");
  positive(uncertainty.position_noise, "position_noise");
  positive(uncertainty.tail.level, "tail: level");
  positive(uncertainty.tail.scale, "tail: scale");
  positive(uncertainty.tail.per_hour, "tail: per_hour");
  not_negative(uncertainty.seconds, "seconds");
}

}  // namespace dynid
