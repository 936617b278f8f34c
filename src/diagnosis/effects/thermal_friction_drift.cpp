// SPDX-License-Identifier: Apache-2.0
// Fv exp(-t / T) dq: viscous friction of a cold joint that warms. A slower one than 15 s cannot be told from
// viscous friction on a short log.
#include "effects.hpp"

namespace dynid::detail {
namespace {

class ThermalFrictionDrift : public OwnTorque {
 public:
  ThermalFrictionDrift() : OwnTorque("thermal_friction_drift", {{"coefficient", "N m s/rad"}}) {}
  bool once() const override { return true; }
  std::vector<ShapeParameter> shape() const override { return {{"time_constant", "s", 1.0, 20.0, 5, true}}; }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    if (!(s.recorded > 0.0)) return shape();
    return {{"time_constant", "s", earliest_of_log * s.recorded, latest_of_log * s.recorded, 5, true}};
  }
  bool approximate() const override { return true; }
  double prior(const Robot&) const override { return 0.4; }

  bool plausible(const Robot& robot, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd&) const override {
    return hinders(robot, unit, usual_speed(robot, unit), c[0]);
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    return motion.speed.col(j).array() * (-motion.t.array() / shape[0]).exp();
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_thermal_friction_drift() { return std::make_unique<ThermalFrictionDrift>(); }

}  // namespace dynid::detail
