// SPDX-License-Identifier: Apache-2.0
// gear_coupling: a shaft that turns with the sum of two joints' speeds, as in geared wrists.
#include <cmath>

#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class GearCoupling : public EffectModel {
 public:
  GearCoupling(const Effect& effect, const Robot&)
      : a_(effect.joints[0] - 1),
        b_(effect.joints[1] - 1),
        ratio_(value(effect, "ratio")),
        viscous_(value(effect, "viscous")),
        coulomb_(value(effect, "coulomb")),
        inertia_(value(effect, "inertia")),
        scale_(value(effect, "velocity_scale")) {}
  bool acts() const override { return true; }
  void add_inertia(Eigen::MatrixXd& M) const override {
    M(a_, a_) += inertia_;
    M(a_, b_) += ratio_ * inertia_;
    M(b_, a_) += ratio_ * inertia_;
    M(b_, b_) += ratio_ * ratio_ * inertia_;
  }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    const double speed = at.dq[a_] + ratio_ * at.dq[b_];
    const double torque = viscous_ * speed + coulomb_ * std::tanh(speed / scale_);
    tau[a_] += torque;
    tau[b_] += ratio_ * torque;
  }
  void add_slopes(const Eigen::VectorXd& dq, const Eigen::VectorXd&, Eigen::VectorXd& damping,
                  Eigen::VectorXd&) const override {
    const double s = std::tanh((dq[a_] + ratio_ * dq[b_]) / scale_);
    const double slope = viscous_ + coulomb_ * (1.0 - s * s) / scale_;
    damping[a_] += (1.0 + std::abs(ratio_)) * slope;
    damping[b_] += (ratio_ * ratio_ + std::abs(ratio_)) * slope;
  }

 private:
  Eigen::Index a_, b_;
  double ratio_, viscous_, coulomb_, inertia_, scale_;
};

void draw_wrist(Effect& effect, const Robot& robot, std::mt19937_64& random, double, double) {
  const int last = robot.size(), first = std::max(1, last - 2);  // two neighbours among the last three
  const int a = std::uniform_int_distribution<int>(first, last - 1)(random);
  effect.joints = {a, a + 1};
}

}  // namespace

std::vector<EffectDefinition> coupling_effects() {
  return {
      {"gear_coupling",
       {{"viscous", {0.4}, {1.5}, false, Scale::times},
        {"coulomb", {0.3}, {1.2}, false, Scale::times},
        {"inertia", {0.03}, {0.15}, false, Scale::times},
        {"ratio", {1.0}, {1.0}, true, Scale::none},
        velocity_scale()},
       &make_model<GearCoupling>,
       &draw_wrist},
  };
}

}  // namespace dynid::detail
