// SPDX-License-Identifier: Apache-2.0
// tau(t - d) - tau(t): the measured torque is late, by the same time on every joint.
#include "dynid/signal/filter.hpp"
#include "effects.hpp"

namespace dynid::detail {
namespace {

class TimeDelay : public Hypothesis {
 public:
  std::string name() const override { return "time_delay"; }
  Scope scope() const override { return Scope::arm; }
  bool shape_only() const override { return true; }
  double lateness(const Eigen::VectorXd& shape) const override { return shape[0]; }
  std::vector<ShapeParameter> shape() const override { return {{"delay_s", "s", -0.05, 0.05, 21, true}}; }
  std::vector<ShapeParameter> shape_on(const JointScale& arm) const override {
    const double latest = latest_of_sweep * arm.duration();
    return {{"delay_s", "s", -latest, latest, 21, true}};
  }
  ColumnBlock columns(const GapMotion& motion, int, const Eigen::VectorXd& shape) const override {
    Eigen::MatrixXd late(motion.samples(), motion.joints());
    for (int j = 0; j < motion.joints(); ++j)
      late.col(j) = interpolate(motion.t, motion.nominal.col(j), motion.t.array() - shape[0]);
    return all_channels({late - motion.nominal});
  }
  std::vector<NamedValue> parameters(const Robot&, int, const Eigen::VectorXd&,
                                     const Eigen::VectorXd& shape) const override {
    return {{"delay_s", "s", shape, false}};
  }
  void restore(const Robot&, const Effect& effect, int, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = Eigen::VectorXd::Ones(1);
    shape = arm_value(effect, "delay_s", 1);
  }
};

}  // namespace

std::unique_ptr<Hypothesis> make_time_delay() { return std::make_unique<TimeDelay>(); }

}  // namespace dynid::detail
