// SPDX-License-Identifier: Apache-2.0
// Backlash in its other form: a dead zone of torque. What turns the joint is the torque less what it takes to
// close the gap, which a sensor on the motor's side sees.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class BacklashDeadZone : public OwnTorque {
 public:
  BacklashDeadZone() : OwnTorque("backlash", {{"dead_zone", "N m"}}) {}
  std::vector<ShapeParameter> shape() const override {
    return {{"contact_torque", "N m", 0.1, 5.0, 3, true}};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    return {{"contact_torque", "N m", 0.005 * s.torque, 0.25 * s.torque, 3, true}};
  }
  std::string form() const override { return "dead_zone"; }
  bool approximate() const override { return true; }
  double prior(const Robot&) const override { return 0.4; }
  bool plausible(const Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return c[0] > 0.0;
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    return (motion.nominal.col(j) / shape[0]).cwiseMax(-1.0).cwiseMin(1.0);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_backlash_dead_zone() { return std::make_unique<BacklashDeadZone>(); }

}  // namespace dynid::detail
