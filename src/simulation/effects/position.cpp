// SPDX-License-Identifier: Apache-2.0
// Torque that is a function of the true position: joint_spring, torque_ripple.
#include <cmath>

#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class JointSpring : public EffectModel {
 public:
  JointSpring(const Effect& effect, const Robot&)
      : stiffness_(values(effect, "stiffness")), rest_(values(effect, "rest")) {}
  bool acts() const override { return true; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    tau.array() += stiffness_.array() * (at.q - rest_).array();
  }
  void add_slopes(const Eigen::VectorXd&, const Eigen::VectorXd&, Eigen::VectorXd&,
                  Eigen::VectorXd& stiffness) const override {
    stiffness += stiffness_.cwiseAbs();
  }

 private:
  Eigen::VectorXd stiffness_, rest_;
};

class TorqueRipple : public EffectModel {
 public:
  TorqueRipple(const Effect& effect, const Robot&)
      : amplitude_(values(effect, "amplitude")),
        order_(values(effect, "order")),
        phase_(values(effect, "phase")) {}
  bool acts() const override { return true; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    for (Eigen::Index j = 0; j < tau.size(); ++j)
      if (amplitude_[j] != 0.0) tau[j] += amplitude_[j] * std::sin(order_[j] * at.q[j] + phase_[j]);
  }
  void add_slopes(const Eigen::VectorXd&, const Eigen::VectorXd&, Eigen::VectorXd&,
                  Eigen::VectorXd& stiffness) const override {
    stiffness.array() += (amplitude_.array() * order_.array()).abs();
  }

 private:
  Eigen::VectorXd amplitude_, order_, phase_;
};

void draw_order(Effect& effect, const Robot&, std::mt19937_64& random, double, double) {
  for (double& order : effect.parameters["order"])  // teeth, poles: a whole number a turn
    order = double(std::uniform_int_distribution<int>(4, 100)(random));
}

}  // namespace

std::vector<EffectDefinition> position_effects() {
  return {
      {"joint_spring",
       {{"stiffness", {0.7}, {3.0}, false, Scale::times}, {"rest", {-0.5}, {0.5}, false, Scale::none}},
       &make_model<JointSpring>},
      {"torque_ripple",
       {{"amplitude", {0.4}, {1.2}, false, Scale::times},
        {"order", {4.0}, {100.0}, false, Scale::none},
        {"phase", {-M_PI}, {M_PI}, false, Scale::none}},
       &make_model<TorqueRipple>,
       &draw_order},
  };
}

}  // namespace dynid::detail
