// SPDX-License-Identifier: Apache-2.0
// The torque stops at +-limit.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class TorqueSaturation : public OwnTorque {
 public:
  TorqueSaturation() : OwnTorque("torque_saturation", {}) {}
  std::vector<ShapeParameter> shape() const override { return {{"limit", "N m", 0.03, 120.0, 33, true}}; }
  bool approximate() const override { return true; }
  bool shape_only() const override { return true; }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const Eigen::ArrayXd tau = motion.nominal.col(j);
    return tau.max(-shape[0]).min(shape[0]) - tau;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_torque_saturation() { return std::make_unique<TorqueSaturation>(); }

}  // namespace dynid::detail
