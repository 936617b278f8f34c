// SPDX-License-Identifier: Apache-2.0
// thermal_friction_drift: viscous friction of a cold joint that goes as the joint warms by moving.
#include <cmath>

#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class ThermalFrictionDrift : public EffectModel {
 public:
  ThermalFrictionDrift(const Effect& effect, const Robot&)
      : coefficient_(values(effect, "coefficient")),
        time_constant_(Eigen::VectorXd::Ones(coefficient_.size())),
        speed_(Eigen::VectorXd::Zero(coefficient_.size())),
        warmth_(speed_) {
    for (const int joint : effect.joints) {
      const Warming w = warming(effect, joint - 1);
      time_constant_[joint - 1] = w.time_constant, speed_[joint - 1] = w.reference_speed;
    }
  }
  bool acts() const override { return true; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    tau.array() += coefficient_.array() * (1.0 - warmth_.array()) * at.dq.array();
  }
  void add_slopes(const Eigen::VectorXd&, const Eigen::VectorXd&, Eigen::VectorXd& damping,
                  Eigen::VectorXd&) const override {
    damping += coefficient_;
  }
  void reset() override { warmth_.setZero(); }
  void advance(const Eigen::VectorXd& dq, double h) override {
    for (Eigen::Index j = 0; j < warmth_.size(); ++j) {
      if (coefficient_[j] == 0.0) continue;
      // Goes with the friction's power; without a speed, by the clock.
      const double heat = speed_[j] > 0.0 ? dq[j] * dq[j] / (speed_[j] * speed_[j]) : 1.0;
      warmth_[j] -= (warmth_[j] - heat) * -std::expm1(-h / time_constant_[j]);
      warmth_[j] = std::min(warmth_[j], 1.0);  // warm through: nothing of it is left
    }
  }

 private:
  Eigen::VectorXd coefficient_, time_constant_, speed_, warmth_;
};

}  // namespace

std::vector<EffectDefinition> thermal_effects() {
  return {
      {"thermal_friction_drift",
       {{"coefficient", {1.5}, {4.0}, false, Scale::times},
        {"time_constant", {3.0}, {10.0}, false, Scale::none},
        {"reference_speed", {0.4}, {0.6}, false, Scale::none}},
       &make_model<ThermalFrictionDrift>},
  };
}

}  // namespace dynid::detail
