// SPDX-License-Identifier: Apache-2.0
// A motor mass of its own behind a spring (joint_elasticity) that may have play (backlash), or whose torque
// is partly lost on the way (backlash with a dead zone).
#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
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
    if (effect.name != "backlash") {
      check(effect);
      return;
    }
    gap_ = values(effect, "gap");
    dead_zone_ = values(effect, "dead_zone");
    check(effect);
  }
  SensorStage stage() const override {
    return dead_zone_.size() > 0 && !dead_zone_.isZero(0.0) ? SensorStage::gain : SensorStage::none;
  }
  void sense(double, Eigen::VectorXd& tau) override {  // on the motor's side: what is lost is there still
    constexpr double closing = 0.05;                   // [N m]
    for (const int joint : joints_)
      tau[joint - 1] += dead_zone_[joint - 1] * std::tanh(tau[joint - 1] / closing);
  }
  void transmission(std::vector<Transmission>& all) const override {
    for (const int joint : joints_) {
      if (lost(joint)) continue;
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
  bool lost(int joint) const { return dead_zone_.size() > 0 && dead_zone_[joint - 1] != 0.0; }
  void check(const Effect& effect) const {
    for (const int joint : joints_)
      if (!lost(joint) && !(stiffness_[joint - 1] > 0.0))
        throw Error("effect '" + effect.name + "': stiffness: the spring of joint " + std::to_string(joint) +
                    " must be stiffer than 0");
  }

  std::vector<int> joints_;
  Eigen::VectorXd stiffness_, inertia_, gap_, dead_zone_;
  double damping_;
};

}  // namespace

std::vector<EffectDefinition> transmission_effects() {
  return {
      {"joint_elasticity",
       {{"stiffness", {1500.0}, {6000.0}, false, Scale::divided},
        {"motor_inertia", {0.2}, {0.5}, false, Scale::none},
        {"damping_ratio", {0.05}, {0.2}, false, Scale::none}},
       &make_model<SpringInJoint>,
       nullptr,
       0.1},
      {"backlash",
       {{"gap", {0.008}, {0.03}, false, Scale::times},
        {"stiffness", {15000.0}, {30000.0}, false, Scale::none},
        {"motor_inertia", {0.2}, {0.5}, false, Scale::none},
        {"damping_ratio", {0.05}, {0.2}, false, Scale::none},
        {"dead_zone", {0.0}, {0.0}, false, Scale::none}},
       &make_model<SpringInJoint>,
       nullptr,
       0.1},
  };
}

}  // namespace dynid::detail
