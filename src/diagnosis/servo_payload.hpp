// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynid/diagnosis/servo_diagnose.hpp"
#include "servo_joint_fit.hpp"

namespace dynid::detail {

/// A point mass on the last link: what a log of positions shows of a payload.
struct ServoPayload {
  bool present = false;
  /// Mass [kg] and first moments [kg m] in the frame of the last link, and their covariance.
  Eigen::Vector4d value = Eigen::Vector4d::Zero();
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  double gain = 0.0;  ///< log evidence beyond its price
  double probability = 0.0;
  /// Its ten standard parameters about the origin of the last link.
  StandardParameters parameters() const;
};

/// What the last link's standard parameters add to each joint's load along the logs.
class PayloadLoads {
 public:
  PayloadLoads(const Robot& nominal, const std::vector<Log>& logs);
  /// Adds the loads of `payload` to joint `joint` (from 0).
  void add(const ServoPayload& payload, int joint, ServoProblemOfJoint& problem) const;

 private:
  /// By parameter, joint, log.
  std::vector<std::vector<std::vector<ServoSeries>>> columns_;
};

/// Fits a payload while every joint keeps the knobs `x`. `gain` is what the joints' evidence rises by, less
/// its price.
ServoPayload fit_payload(const Robot& nominal, const PayloadLoads& loads,
                         const std::vector<ServoProblemOfJoint>& joints, const std::vector<KnobFit>& fits,
                         const std::vector<double>& samples, const ServoPayload& start = {});

}  // namespace dynid::detail
