// SPDX-License-Identifier: Apache-2.0
// A motor mass of its own behind a spring (joint_elasticity) that may have play (backlash), or whose torque
// is partly lost on the way (backlash with a dead zone).
#include <algorithm>
#include <cmath>

#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class SpringInJoint : public EffectModel {
 public:
  SpringInJoint(const Effect& effect, const Robot&)
      : joints_(effect.joints),
        stiffness_(values(effect, "stiffness")),
        inertia_(values(effect, "motor_inertia")),
        damping_(value(effect, "damping_ratio")) {
    if (effect.name != "backlash") return;
    gap_ = values(effect, "gap");
    dead_zone_ = values(effect, "dead_zone");
  }
  SensorStage stage() const override {
    return dead_zone_.size() > 0 && dead_zone_.maxCoeff() > 0.0 ? SensorStage::gain : SensorStage::none;
  }
  void sense(double, Eigen::VectorXd& tau) override {  // on the motor's side: what is lost is there still
    constexpr double closing = 0.05;                   // [N m]
    for (const int joint : joints_)
      tau[joint - 1] += dead_zone_[joint - 1] * std::tanh(tau[joint - 1] / closing);
  }
  void transmission(std::vector<Transmission>& all) const override {
    for (const int joint : joints_) {
      if (dead_zone_.size() > 0 && dead_zone_[joint - 1] > 0.0) continue;
      Transmission& t = all[static_cast<std::size_t>(joint - 1)];
      const double k = stiffness_[joint - 1];
      // Two springs in a row, when a joint has both effects.
      t.stiffness = t.stiffness > 0.0 ? 1.0 / (1.0 / t.stiffness + 1.0 / k) : k;
      t.damping_ratio = std::max(t.damping_ratio, damping_);
      t.motor_inertia = std::max(t.motor_inertia, inertia_[joint - 1]);
      if (gap_.size() > 0) t.gap += gap_[joint - 1];
    }
  }

 private:
  std::vector<int> joints_;
  Eigen::VectorXd stiffness_, inertia_, gap_, dead_zone_;
  double damping_;
};

EffectParameter stiffness(double initial, double low, double high, Scale scale) {
  return {"stiffness", "N m/rad", "of the spring", true, {initial}, 10.0, 1e6, {low}, {high}, false, scale};
}
EffectParameter motor_inertia() {
  return {"motor_inertia", "kg m^2", "of the motor, at the joint", true, {0.3}, 1e-3, 100.0, {0.2}, {0.5}};
}
EffectParameter damping_ratio() {
  return {"damping_ratio", "1", "of the motor on the spring", false, {0.1}, 0.0, 1.0, {0.05}, {0.2}};
}

}  // namespace

std::vector<EffectDefinition> transmission_effects() {
  return {{{"joint_elasticity",
            "a motor mass behind a spring K: tau = K (theta - q), theta the position measured",
            EffectScope::joints,
            {stiffness(5000.0, 1500.0, 6000.0, Scale::divided), motor_inertia(), damping_ratio()}},
           &make_model<SpringInJoint>,
           nullptr,
           0.1},
          {{"backlash",
            "the same with a stiff spring that has play: no torque inside the gap",
            EffectScope::joints,
            {{"gap",
              "rad",
              "of the dead zone, from end to end",
              true,
              {0.01},
              0.0,
              1.0,
              {0.008},
              {0.03},
              false,
              Scale::times},
             stiffness(20000.0, 15000.0, 30000.0, Scale::none),
             motor_inertia(),
             damping_ratio(),
             {"dead_zone",
              "N m",
              "torque that is lost on the way: such a joint has this instead of gap and spring",
              true,
              {0.0},
              0.0,
              1e3,
              {0.0},
              {0.0}}}},
           &make_model<SpringInJoint>,
           nullptr,
           0.1}};
}

}  // namespace dynid::detail
