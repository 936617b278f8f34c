// SPDX-License-Identifier: Apache-2.0
// The link lies at one end of the gap or at the other, as the sign of its torque says; between, within the
// torque that it takes to close it. Closing it takes torque, which a sensor on the motor's side sees: a dead
// zone.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class Backlash : public OwnTorque {
 public:
  Backlash() : OwnTorque("backlash", {}) {}
  std::vector<ShapeParameter> shape() const override {
    return {{"contact_torque", "N m", 0.1, 5.0, 3, true}};
  }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    const Eigen::VectorXd side = (motion.rigid.col(unit).array() / shape[0]).tanh();
    Eigen::MatrixXd dead_zone = Eigen::MatrixXd::Zero(motion.samples(), motion.joints());
    dead_zone.col(unit) = (motion.rigid.col(unit) / shape[0]).cwiseMax(-1.0).cwiseMin(1.0);
    return all_channels({shifted_joint(motion, unit, -0.5 * side), dead_zone});
  }
  std::vector<NamedValue> parameters(const Robot&, int, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd& shape) const override {
    return {{"gap", "rad", c.head(1)}, {"dead_zone", "N m", c.tail(1)}, {"contact_torque", "N m", shape}};
  }
  void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = Eigen::Vector2d(joint_value(robot, effect, "gap", unit),
                        joint_value(robot, effect, "dead_zone", unit));
    shape = Eigen::VectorXd::Constant(1, joint_value(robot, effect, "contact_torque", unit));
  }
  double prior() const override { return 0.4; }
  bool plausible(const Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return c.maxCoeff() > 0.0;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_backlash() { return std::make_unique<Backlash>(); }

}  // namespace dynid::detail
