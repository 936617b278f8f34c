// SPDX-License-Identifier: Apache-2.0
// Saturation in its other form: the log has the torque that was asked for, the joint got no more than +-limit.
#include "effects.hpp"

namespace dynid::detail {
namespace {

Eigen::ArrayXd beyond(const Eigen::ArrayXd& tau, double limit) { return tau - tau.max(-limit).min(limit); }

class TorqueSaturationOfCommand : public OwnTorque {
 public:
  TorqueSaturationOfCommand() : OwnTorque("torque_saturation", {}) {}
  std::string form() const override { return "command_limit"; }
  std::vector<ShapeParameter> shape() const override { return {{"command_limit", "N m", 0.3, 120.0, 24, true}}; }
  bool shape_only() const override { return true; }
  double prior() const override { return 0.4; }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    // What was asked for and not got, the motion does not know: it is in the measured torque alone. What the
    // motion shows beyond the limit was got, and speaks against that limit.
    return beyond(motion.tau.col(j), shape[0]) + beyond(motion.nominal.col(j), shape[0]);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_torque_saturation_of_command() {
  return std::make_unique<TorqueSaturationOfCommand>();
}

}  // namespace dynid::detail
