// SPDX-License-Identifier: Apache-2.0
// The torque stops at +-limit.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class TorqueSaturation : public OwnTorque {
 public:
  TorqueSaturation() : OwnTorque("torque_saturation", {}) {}
  std::vector<ShapeParameter> shape() const override { return {{"limit", "N m", 0.03, 120.0, 33, true}}; }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    return {{"limit", "N m", 0.03 * s.torque, 8.0 * s.torque, 33, true}};
  }
  bool approximate() const override { return true; }
  bool shape_only() const override { return true; }

  bool reachable(const std::vector<JointRange>& ranges, int unit, const Eigen::VectorXd&,
                 const Eigen::VectorXd& shape) const override {
    // The log may stand at the limit, with the noise that it has, but not beyond.
    constexpr double room = 0.1;
    return shape[0] > (1.0 - room) * ranges[static_cast<std::size_t>(unit)].torque;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const Eigen::ArrayXd tau = motion.nominal.col(j);
    return tau.max(-shape[0]).min(shape[0]) - tau;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_torque_saturation() { return std::make_unique<TorqueSaturation>(); }

}  // namespace dynid::detail
