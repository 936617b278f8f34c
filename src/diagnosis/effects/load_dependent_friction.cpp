// SPDX-License-Identifier: Apache-2.0
// Fl |tau| sgn dq, tau the torque that passes through the joint, this friction included.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class LoadDependentFriction : public OwnTorque {
 public:
  LoadDependentFriction() : OwnTorque("load_dependent_friction", {}) {}
  bool shape_only() const override { return true; }
  bool approximate() const override { return true; }
  double prior(const Robot&) const override { return 0.7; }
  std::vector<ShapeParameter> shape() const override {
    return {{"coefficient", "1", 0.005, 0.6, 8, true}, sign_width()};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    return {shape().front(), sign_width(s)};
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const Eigen::ArrayXd sign = smooth_signs(motion, j, shape[1]).array(), load = motion.rigid.col(j).array();
    return shape[0] * sign * load.abs() / (1.0 - shape[0] * sign * load.sign());
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_load_dependent_friction() {
  return std::make_unique<LoadDependentFriction>();
}

}  // namespace dynid::detail
