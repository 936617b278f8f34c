// SPDX-License-Identifier: Apache-2.0
// Play between motor and link: a spring that transmits no torque inside the gap. The link crosses it on a
// path of its own, driven by gravity, its neighbours and its friction, and meets the other end with a blow.
#include <algorithm>
#include <cmath>

#include "../spring_in_joint.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

// Of the link on the spring: what the motor behind it takes of a blow. Without bounces a path is wrong by no
// more than the bounces; with bounces that come at other instants it is wrong by twice as much.
constexpr double damping_ratio = 1.0;
constexpr double least = 3e-4, widest = 0.045;      // gap, in parts of the travel
constexpr double slowest = 20.0, quickest = 400.0;  // [1/duration of a sweep] of the link on the spring
// Beyond, all springs look alike.
constexpr double fastest = 600.0;  // [1/duration of a sweep]

class Backlash : public OwnTorque {
 public:
  Backlash() : OwnTorque("backlash", {}) {}
  std::string form() const override { return "gap"; }
  bool shape_only() const override { return true; }
  std::vector<ShapeParameter> shape() const override {
    return {{"gap", "rad", 0.0007, 0.12, 15, true}, {"stiffness", "N m/rad", 200.0, 30000.0, 3, true}};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    const double slow = slowest / s.duration(), quick = quickest / s.duration();
    return {{"gap", "rad", least * s.travel, widest * s.travel, 15, true},
            {"stiffness", "N m/rad", s.inertia * slow * slow, s.inertia * quick * quick, 3, true}};
  }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    const double travel = motion.q.col(unit).maxCoeff() - motion.q.col(unit).minCoeff();
    const double sweep = travel / std::max(motion.dq.col(unit).cwiseAbs().maxCoeff(), 1e-12 * travel);
    const double stiffest = sweep > 0.0 ? motion.inertia(unit).minCoeff() * std::pow(fastest / sweep, 2)
                                        : shape[1];  // a joint that rests: no spring of it is seen
    return all_channels(
        {spring_torque(motion, unit, {std::min(shape[1], stiffest), shape[0], damping_ratio})});
  }
  bool approximate() const override { return true; }
  double prior(const Robot&) const override { return 0.4; }
  bool reachable(const std::vector<JointRange>& ranges, int unit, const Eigen::VectorXd&,
                 const Eigen::VectorXd& shape) const override {
    // Less is a spring's alone: joint_elasticity.
    return shape[0] > 1.5 * least * ranges[static_cast<std::size_t>(unit)].scale.travel;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_backlash() { return std::make_unique<Backlash>(); }

}  // namespace dynid::detail
