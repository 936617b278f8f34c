// SPDX-License-Identifier: Apache-2.0
// (Fs - Fc) exp(-|dq / vs|^delta) sgn dq: what breaking away takes beyond Coulomb friction; delta from 1
// (Tustin) to 2.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class StribeckFriction : public OwnTorque {
 public:
  StribeckFriction() : OwnTorque("stribeck_friction", {{"static", "N m"}}) {}
  std::vector<ShapeParameter> shape() const override {
    return {{"stribeck_velocity", "rad/s", 0.02, 0.6, 6, true},
            // Narrower than the bump itself: else the two would only be a factor.
            {"velocity_scale", "rad/s", 0.002, 0.03, 3, true},
            {"exponent", "1", 1.0, 2.0, 3, false}};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    return {{"stribeck_velocity", "rad/s", 0.01 * s.speed, 0.5 * s.speed, 6, true},
            {"velocity_scale", "rad/s", 1e-3 * s.speed, 0.015 * s.speed, 3, true},
            shape().back()};
  }
  bool approximate() const override { return true; }

  bool plausible(const Robot& robot, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd& shape) const override {
    return hinders(robot, unit, shape[0], c[0]);
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const Eigen::ArrayXd x = (motion.speed.col(j).array() / shape[0]).abs();
    return smooth_signs(motion, j, shape[1]).array() * (-x.pow(shape[2])).exp();
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_stribeck_friction() { return std::make_unique<StribeckFriction>(); }

}  // namespace dynid::detail
