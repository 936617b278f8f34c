// SPDX-License-Identifier: Apache-2.0
// Fl |tau| sgn dq, tau the torque that passes through the joint.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class LoadDependentFriction : public OwnTorque {
 public:
  LoadDependentFriction() : OwnTorque("load_dependent_friction", {{"coefficient", "1"}}) {}
  double prior() const override { return 0.7; }
  std::vector<ShapeParameter> shape() const override { return {sign_width()}; }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    return smooth_signs(motion, j, shape[0]).array() * motion.rigid.col(j).array().abs();
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_load_dependent_friction() {
  return std::make_unique<LoadDependentFriction>();
}

}  // namespace dynid::detail
