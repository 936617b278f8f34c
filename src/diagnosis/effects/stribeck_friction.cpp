// SPDX-License-Identifier: Apache-2.0
// (Fs - Fc) exp(-(dq / vs)^2) sgn dq: what breaking away takes beyond Coulomb friction.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class StribeckFriction : public OwnTorque {
 public:
  StribeckFriction() : OwnTorque("stribeck_friction", {{"static", "N m"}}) {}
  std::vector<ShapeParameter> shape() const override {
    return {{"stribeck_velocity", "rad/s", 0.02, 0.6, 6, true}, sign_width()};
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const Eigen::ArrayXd x = motion.dq.col(j).array() / shape[0];
    return smooth_signs(motion, j, shape[1]).array() * (-x.square()).exp();
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_stribeck_friction() { return std::make_unique<StribeckFriction>(); }

}  // namespace dynid::detail
