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
constexpr double least = 0.0007;  // [rad]
constexpr double fastest = 60.0;  // [Hz] of the link on the spring: beyond, all springs look alike

class Backlash : public OwnTorque {
 public:
  Backlash() : OwnTorque("backlash", {}) {}
  std::string form() const override { return "gap"; }
  bool shape_only() const override { return true; }
  std::vector<ShapeParameter> shape() const override {
    return {{"gap", "rad", least, 0.12, 15, true}, {"stiffness", "N m/rad", 200.0, 30000.0, 3, true}};
  }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    const double stiffest = motion.inertia(unit).minCoeff() * std::pow(2.0 * M_PI * fastest, 2);
    return all_channels(
        {spring_torque(motion, unit, {std::min(shape[1], stiffest), shape[0], damping_ratio})});
  }
  bool approximate() const override { return true; }
  double prior() const override { return 0.4; }
  bool plausible(const Robot&, int, const Eigen::VectorXd&, const Eigen::VectorXd& shape) const override {
    return shape[0] > 1.5 * least;  // less is a spring's alone: joint_elasticity
  }

 protected:
  Eigen::MatrixXd own(const GapMotion&, int, const Eigen::VectorXd&) const override { return {}; }
};

}  // namespace

std::unique_ptr<Hypothesis> make_backlash() { return std::make_unique<Backlash>(); }

}  // namespace dynid::detail
