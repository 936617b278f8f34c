// SPDX-License-Identifier: Apache-2.0
// Fc+ in one direction, Fc- in the other.
#include "effects.hpp"

#include <cmath>

namespace dynid::detail {
namespace {

constexpr double least_asymmetry = 0.15;  // of the sum: three to two and a quarter

class AsymmetricCoulombFriction : public OwnTorque {
 public:
  AsymmetricCoulombFriction()
      : OwnTorque("asymmetric_coulomb_friction",
                  {{"coefficient_positive", "N m"}, {"coefficient_negative", "N m"}}) {}
  double prior(const Robot&) const override { return 0.3; }
  std::vector<ShapeParameter> shape() const override { return {sign_width()}; }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override { return {sign_width(s)}; }
  bool plausible(const Robot& robot, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd& shape) const override {
    // Friction hinders in either direction: what helps in one is an offset.
    for (const double torque : c)
      if (!hinders(robot, unit, 3.0 * shape[0], torque)) return false;
    // Nearly even, it is Coulomb friction, and what makes it uneven may be anything with an offset.
    if (std::abs(c[0] - c[1]) < least_asymmetry * c.cwiseAbs().sum()) return false;
    // More by one direction and less by the other, it changes an offset as well.
    return c[0] * c[1] > 0.0 || std::abs(c.sum()) > 0.5 * c.cwiseAbs().maxCoeff();
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const Eigen::ArrayXd s = smooth_signs(motion, j, shape[0]);
    Eigen::MatrixXd both(s.size(), 2);
    both << s.max(0.0), s.min(0.0);
    return both;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_asymmetric_coulomb_friction() {
  return std::make_unique<AsymmetricCoulombFriction>();
}

}  // namespace dynid::detail
