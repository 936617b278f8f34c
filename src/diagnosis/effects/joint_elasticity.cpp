// SPDX-License-Identifier: Apache-2.0
// The link lags the measured motor by tau / K: linear in 1 / K.
#include "effects.hpp"
#include "named.hpp"

namespace dynid::detail {
namespace {

class JointElasticity : public OwnTorque {
 public:
  JointElasticity() : OwnTorque("joint_elasticity", {}) {}
  bool approximate() const override { return true; }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd&) const override {
    return all_channels({motion.shifted(unit, -motion.rigid.col(unit))});
  }
  std::vector<NamedValue> parameters(const Robot& robot, int unit, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd&) const override {
    return {named(name(), "stiffness", robot, unit, c[0] != 0.0 ? 1.0 / c[0] : 0.0)};
  }
  void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = Eigen::VectorXd::Constant(1, 1.0 / joint_value(robot, effect, "stiffness", unit));
    shape.resize(0);
  }
  bool plausible(const Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return c[0] > 0.0;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_joint_elasticity() { return std::make_unique<JointElasticity>(); }

}  // namespace dynid::detail
