// SPDX-License-Identifier: Apache-2.0
// Thermal drift in its other form: the joint warms by its own motion, Fv exp(-H / H0) dq with H the integral
// of dq^2.
#include <cmath>

#include "dynid/effect/derived.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

class ThermalFrictionDriftByMotion : public OwnTorque {
 public:
  ThermalFrictionDriftByMotion() : OwnTorque("thermal_friction_drift", {{"coefficient", "N m s/rad"}}) {}
  std::string form() const override { return "motion_constant"; }
  bool approximate() const override { return true; }
  bool once() const override { return true; }
  std::vector<ShapeParameter> shape() const override {
    return {{"motion_constant", "rad^2/s", 0.2, 6.0, 5, true}};
  }
  std::vector<ShapeParameter> shape_on(const JointScale& s) const override {
    constexpr double earliest_of_heat = 0.02;  // of the log's: a joint that sheds it, too, is warm sooner
    constexpr double usual = 0.2;              // of the largest speed's square, the mean one's
    const double whole = s.recorded > 0.0 ? usual * s.speed * s.speed * s.recorded  // the integral of dq^2
                                          : s.travel * s.speed;
    return {{"motion_constant", "rad^2/s", earliest_of_heat * whole, latest_of_log * whole, 6, true}};
  }
  void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = Eigen::VectorXd::Constant(1, joint_value(robot, effect, "coefficient", unit));
    shape = Eigen::VectorXd::Constant(1, motion_constant(effect, unit));
  }
  double prior(const Robot&) const override { return 0.4; }

  bool plausible(const Robot& robot, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd&) const override {
    return hinders(robot, unit, usual_speed(robot, unit), c[0]);
  }

 protected:
  Eigen::MatrixXd own(const GapMotion& motion, int j, const Eigen::VectorXd& shape) const override {
    const Eigen::VectorXd& speed = motion.speed.col(j);
    Eigen::VectorXd torque(motion.samples());
    double heat = motion.worked[j];
    for (Eigen::Index i = 0; i < torque.size(); ++i) {
      torque[i] = speed[i] * std::exp(-heat / shape[0]);
      heat += speed[i] * speed[i] / motion.rate;
    }
    return torque;
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_thermal_friction_drift_by_motion() {
  return std::make_unique<ThermalFrictionDriftByMotion>();
}

}  // namespace dynid::detail
