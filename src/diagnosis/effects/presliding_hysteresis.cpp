// SPDX-License-Identifier: Apache-2.0
// A Maxwell slip element: a spring that slips at its Coulomb torque, bent by slip [rad] until then.
#include "dynid/effect/derived.hpp"
#include "effects.hpp"

#include <algorithm>
#include <string>

#include "dynid/base/error.hpp"

namespace dynid::detail {
namespace {

class PreslidingHysteresis : public OwnTorque {
 public:
  PreslidingHysteresis() : OwnTorque("presliding_hysteresis", {{"coulomb", "N m"}}) {}
  std::vector<ShapeParameter> shape() const override { return {{"slip", "rad", 0.01, 0.4, 6, true}}; }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    return {{"slip", "rad", 0.004 * s.travel, 0.15 * s.travel, 6, true}};
  }
  void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = Eigen::VectorXd::Constant(1, joint_value(robot, effect, "coulomb", unit));
    shape = Eigen::VectorXd::Constant(1, bristle_slip(effect, unit));  // a bristle has one too
    if (!(shape[0] > 0.0))
      throw Error("effect 'presliding_hysteresis': slip, or coulomb and stiffness, of joint " +
                  std::to_string(unit + 1) + " must be positive");
  }
  bool approximate() const override { return true; }
  double prior(const Robot&) const override { return 0.4; }  // Coulomb friction where the slip is small

  bool plausible(const Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return c[0] > 0.0;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const double slip = shape[0];
    Eigen::VectorXd torque(motion.samples());
    double bent = 0.0;
    for (Eigen::Index i = 0; i < torque.size(); ++i) {
      if (i > 0) bent = std::clamp(bent + motion.q(i, j) - motion.q(i - 1, j), -slip, slip);
      torque[i] = bent / slip;
    }
    return torque;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_presliding_hysteresis() { return std::make_unique<PreslidingHysteresis>(); }

}  // namespace dynid::detail
