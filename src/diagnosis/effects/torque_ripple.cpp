// SPDX-License-Identifier: Apache-2.0
// A sin(N q + phase): cogging, gear teeth, a strain wave.
#include "effects.hpp"
#include "named.hpp"

#include <cmath>

namespace dynid::detail {
namespace {

class TorqueRipple : public OwnTorque {
 public:
  TorqueRipple() : OwnTorque("torque_ripple", {}) {}
  std::vector<ShapeParameter> shape() const override { return {{"order", "1/rad", 2.0, 202.0, 401, false}}; }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    // A turn has no unit; of a joint that slides, as many in its travel as in that of a joint that turns.
    if (s.type != JointType::prismatic) return shape();
    return {{"order", "1/rad", 5.0 / s.travel, 505.0 / s.travel, 401, false}};
  }
  std::vector<NamedValue> parameters(const Robot& robot, int unit, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd& shape) const override {
    return {named(name(), "amplitude", robot, unit, c.norm()),
            named(name(), "order", robot, unit, shape[0]),
            {"phase", "rad", Eigen::VectorXd::Constant(1, std::atan2(c[1], c[0]))}};
  }
  void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    const double a = joint_value(robot, effect, "amplitude", unit),
                 phase = joint_value(robot, effect, "phase", unit);
    c = Eigen::Vector2d(a * std::cos(phase), a * std::sin(phase));
    shape = Eigen::VectorXd::Constant(1, joint_value(robot, effect, "order", unit));
  }
  bool approximate() const override { return true; }  // where the joint stands between stamps blurs it
  double prior(const Robot&) const override { return 0.4; }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const Eigen::ArrayXd angle = shape[0] * motion.q.col(j).array();
    Eigen::MatrixXd both(angle.size(), 2);
    both << angle.sin(), angle.cos();
    return both;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_torque_ripple() { return std::make_unique<TorqueRipple>(); }

}  // namespace dynid::detail
