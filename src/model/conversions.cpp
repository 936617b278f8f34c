// SPDX-License-Identifier: Apache-2.0
#include "conversions.hpp"

#include <cmath>

namespace dynid::detail {

Eigen::Matrix3d rotation_from_rpy(const Eigen::Vector3d& rpy) {
  return (Eigen::AngleAxisd(rpy[2], Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Vector3d rpy_from_rotation(const Eigen::Matrix3d& R) {
  // Roll is ill-defined near the singular pitch; taking it off first leaves Rz(yaw) Ry(pitch), whose angles
  // are well-defined, so that the three angles together always reproduce R to rounding.
  const double roll = std::atan2(R(2, 1), R(2, 2));
  const Eigen::Matrix3d zy = R * Eigen::AngleAxisd(-roll, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const Eigen::Vector3d rpy(roll, std::atan2(-zy(2, 0), zy(2, 2)), std::atan2(-zy(0, 1), zy(1, 1)));
  return rpy + Eigen::Vector3d::Zero();  // -0 becomes 0
}

bool has_centre_of_mass(const StandardParameters& p) {
  const StandardParameters again = to_standard(from_standard(p));
  const auto within = [](const auto& a, const auto& b) {
    return (a - b).cwiseAbs().maxCoeff() <= 1e-15 * b.cwiseAbs().maxCoeff();
  };
  return within(again.segment<3>(1), p.segment<3>(1)) && within(again.tail<6>(), p.tail<6>());
}

}  // namespace dynid::detail
