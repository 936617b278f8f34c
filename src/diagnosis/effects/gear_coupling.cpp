// SPDX-License-Identifier: Apache-2.0
// Friction and inertia on the sum (or difference) of two joints' speeds, as in geared wrists.
#include "dynid/base/error.hpp"
#include "effects.hpp"
#include "named.hpp"

namespace dynid::detail {
namespace {

class GearCoupling : public Hypothesis {
 public:
  std::string name() const override { return "gear_coupling"; }
  Scope scope() const override { return Scope::pair; }
  bool approximate() const override { return true; }
  double prior(const Robot&) const override { return 0.3; }
  std::vector<ShapeParameter> shape() const override {
    return {{"ratio", "1", -1.0, 1.0, 2, false}, sign_width()};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    return {shape().front(), sign_width(s)};
  }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    const auto [first, second] = pair_of(motion.joints(), unit);
    const Eigen::VectorXd speed = motion.speed.col(first) + shape[0] * motion.speed.col(second);
    Eigen::MatrixXd own(motion.samples(), 3);
    own << speed, (speed.array() / shape[1]).tanh(),
        motion.ddq.col(first) + shape[0] * motion.ddq.col(second);
    return {{first, second}, {own, shape[0] * own}};
  }
  bool plausible(const Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return c.minCoeff() > -0.05 * c.cwiseAbs().maxCoeff();  // a shaft takes power, and has mass
  }
  std::vector<NamedValue> parameters(const Robot& robot, int unit, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd& shape) const override {
    const int first = pair_of(robot.size(), unit).first;
    return {named(name(), "viscous", robot, first, c[0]), named(name(), "coulomb", robot, first, c[1]),
            named(name(), "inertia", robot, first, c[2]), named(name(), "ratio", robot, first, shape[0]),
            named(name(), "velocity_scale", robot, first, shape[1])};
  }
  void restore(const Robot&, const Effect& effect, int, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c.resize(3);
    c << arm_value(effect, "viscous", 1), arm_value(effect, "coulomb", 1), arm_value(effect, "inertia", 1);
    shape.resize(2);
    shape << arm_value(effect, "ratio", 1), arm_value(effect, "velocity_scale", 1);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_gear_coupling() { return std::make_unique<GearCoupling>(); }

}  // namespace dynid::detail
