// SPDX-License-Identifier: Apache-2.0
// The link lies at one end of the gap or at the other, as the sign of its torque says; between, within the
// torque that it takes to close it.
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
    return all_channels({shifted_joint(motion, unit, -0.5 * side)});
  }
  std::vector<NamedValue> parameters(const Robot&, int, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd& shape) const override {
    return {{"gap", "rad", c}, {"contact_torque", "N m", shape}};
  }
  void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = Eigen::VectorXd::Constant(1, joint_value(robot, effect, "gap", unit));
    shape = Eigen::VectorXd::Constant(1, joint_value(robot, effect, "contact_torque", unit));
  }
  double prior() const override { return 0.4; }
  bool plausible(const Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return c[0] > 0.0;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_backlash() { return std::make_unique<Backlash>(); }

}  // namespace dynid::detail
