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
  return {{{"joint_spring",
            "k (q - q0): cable, counterbalance",
            EffectScope::joints,
            {{"stiffness", "N m/rad", "k", true, {2.0}, -1e4, 1e4, {0.7}, {3.0}, false, Scale::times},
             {"rest", "rad", "q0", true, {0.0}, -any, any, {-0.5}, {0.5}}}},
           &make_model<JointSpring>},
          {{"torque_ripple",
            "A sin(N q + phase)",
            EffectScope::joints,
            {{"amplitude", "N m", "A", true, {0.5}, -1e3, 1e3, {0.4}, {1.2}, false, Scale::times},
             {"order", "1/rad", "N, periods a turn", true, {12.0}, 0.0, 1e4, {4.0}, {100.0}},
             {"phase", "rad", "", true, {0.0}, -any, any, {-M_PI}, {M_PI}}}},
           &make_model<TorqueRipple>,
           &draw_order}};
}

}  // namespace dynid::detail
