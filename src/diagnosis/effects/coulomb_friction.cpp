// SPDX-License-Identifier: Apache-2.0
// Fc sgn dq.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class CoulombFriction : public OwnTorque {
 public:
  CoulombFriction() : OwnTorque("coulomb_friction", {{"coefficient", "N m"}}) {}
  std::vector<ShapeParameter> shape() const override { return {sign_width()}; }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    return smooth_signs(motion, j, shape[0]);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_coulomb_friction() { return std::make_unique<CoulombFriction>(); }

}  // namespace dynid::detail
