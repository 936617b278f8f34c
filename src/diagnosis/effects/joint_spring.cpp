// SPDX-License-Identifier: Apache-2.0
// k (q - q0): cable, counterbalance.
#include <cmath>

#include "effects.hpp"
#include "named.hpp"

namespace dynid::detail {
namespace {

class JointSpring : public OwnTorque {
 public:
  JointSpring() : OwnTorque("joint_spring", {}) {}
  std::vector<NamedValue> parameters(const Robot& robot, int unit, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd&) const override {
    return {named(name(), "stiffness", robot, unit, c[0]),
            named(name(), "rest", robot, unit, c[0] != 0.0 ? -c[1] / c[0] : 0.0)};
  }
  void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    const double k = joint_value(robot, effect, "stiffness", unit);
    c = Eigen::Vector2d(k, -k * joint_value(robot, effect, "rest", unit));
    shape.resize(0);
  }

  bool reachable(const std::vector<JointRange>& ranges, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd&) const override {
    // At rest far from where the joint comes, it pulls alike everywhere: an offset.
    constexpr double least_change = 0.5;  // from the middle to an end, of what it pulls with in the middle
    if (!(c[0] > 0.0)) return false;
    const JointRange& range = ranges[static_cast<std::size_t>(unit)];
    const double rest = -c[1] / c[0], room = 0.5 * (1.0 / least_change - 1.0) * (range.upper - range.lower);
    return rest > range.lower - room && rest < range.upper + room;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd&) const override {
    Eigen::MatrixXd both(motion.samples(), 2);
    both << motion.q.col(j), Eigen::VectorXd::Ones(motion.samples());
    return both;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_joint_spring() { return std::make_unique<JointSpring>(); }

}  // namespace dynid::detail
