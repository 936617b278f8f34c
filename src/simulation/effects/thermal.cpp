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
        time_constant_(values(effect, "time_constant")),
        speed_(values(effect, "reference_speed")),
        warmth_(Eigen::VectorXd::Zero(coefficient_.size())) {}
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
      const double heat = dq[j] * dq[j] / (speed_[j] * speed_[j]);  // goes with the friction's power
      warmth_[j] -= (warmth_[j] - heat) * -std::expm1(-h / time_constant_[j]);
      warmth_[j] = std::min(warmth_[j], 1.0);  // warm through: nothing of it is left
    }
  }

 private:
  Eigen::VectorXd coefficient_, time_constant_, speed_, warmth_;
};

}  // namespace

std::vector<EffectDefinition> thermal_effects() {
  return {{{"thermal_friction_drift",
            "Fv (1 - w) dq, T dw/dt = (dq / v)^2 - w: a cold joint that warms by moving",
            EffectScope::joints,
            {{"coefficient",
              "N m s/rad",
              "Fv, when cold",
              true,
              {2.0},
              0.0,
              1000.0,
              {1.5},
              {4.0},
              false,
              Scale::times},
             {"time_constant", "s", "T", true, {8.0}, 0.1, 1e5, {3.0}, {10.0}},
             {"reference_speed",
              "rad/s",
              "v: speed that keeps it warm",
              true,
              {0.5},
              1e-3,
              100.0,
              {0.4},
              {0.6}}}},
           &make_model<ThermalFrictionDrift>}};
}

}  // namespace dynid::detail
