// SPDX-License-Identifier: Apache-2.0
// Fc sgn dq.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class CoulombFriction : public OwnTorque {
 public:
  CoulombFriction() : OwnTorque("coulomb_friction", {{"coefficient", "N m"}}) {}
  std::vector<ShapeParameter> shape() const override { return {sign_width()}; }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override { return {sign_width(s)}; }

  bool plausible(const Robot& robot, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd& shape) const override {
    return hinders(robot, unit, 3.0 * shape[0], c[0]);
  }
  double prior(const Robot& nominal) const override {
    return without_friction(nominal) ? of_what_all_have : 1.0;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    return smooth_signs(motion, j, shape[0]);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_coulomb_friction() { return std::make_unique<CoulombFriction>(); }

}  // namespace dynid::detail
