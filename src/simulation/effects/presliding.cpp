// SPDX-License-Identifier: Apache-2.0
// presliding_hysteresis as LuGre friction (Canudas de Wit et al. 1995): a bristle that bends before it slips.
#include <cmath>

#include "dynid/base/error.hpp"
#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class PreslidingHysteresis : public EffectModel {
 public:
  PreslidingHysteresis(const Effect& effect, const Robot&)
      : coulomb_(values(effect, "coulomb")),
        stiffness_(Eigen::VectorXd::Ones(coulomb_.size())),
        damping_(values(effect, "damping")),
        bend_(Eigen::VectorXd::Zero(coulomb_.size())) {
    for (const int joint : effect.joints) {
      const Eigen::Index j = joint - 1;
      if (coulomb_[j] == 0.0) continue;
      stiffness_[j] = bristle_stiffness(effect, joint - 1);
      if (!(coulomb_[j] > 0.0) || !(stiffness_[j] > 0.0))
        throw Error("effect 'presliding_hysteresis': coulomb, and stiffness or slip, of joint " +
                    std::to_string(joint) + " must be positive for a bristle to slip");
    }
  }
  bool acts() const override { return true; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    for (Eigen::Index j = 0; j < tau.size(); ++j) {
      if (coulomb_[j] == 0.0) continue;
      const double v = at.dq[j], rate = v - std::abs(v) * stiffness_[j] / coulomb_[j] * bend_[j];
      tau[j] += stiffness_[j] * bend_[j] + damping_[j] * rate;
    }
  }
  void add_slopes(const Eigen::VectorXd&, const Eigen::VectorXd&, Eigen::VectorXd& damping,
                  Eigen::VectorXd& stiffness) const override {
    for (Eigen::Index j = 0; j < coulomb_.size(); ++j) {
      if (coulomb_[j] == 0.0) continue;
      damping[j] += 2.0 * damping_[j];
      stiffness[j] += stiffness_[j];
    }
  }
  void reset() override { bend_.setZero(); }
  void advance(const Eigen::VectorXd& dq, double h) override {
    // dz/dt = v - |v| z / z_s has a closed form where v is held, however stiff it is at speed.
    for (Eigen::Index j = 0; j < bend_.size(); ++j) {
      if (coulomb_[j] == 0.0) continue;
      const double limit = coulomb_[j] / stiffness_[j], x = std::abs(dq[j]) * h / limit;
      bend_[j] = bend_[j] * std::exp(-x) - std::copysign(limit, dq[j]) * std::expm1(-x);
    }
  }

 private:
  Eigen::VectorXd coulomb_, stiffness_, damping_, bend_;
};

}  // namespace

std::vector<EffectDefinition> presliding_effects() {
  return {
      {"presliding_hysteresis",
       {{"coulomb", {1.0}, {3.0}, false, Scale::times},
        {"stiffness", {15.0}, {100.0}, false, Scale::times},
        {"damping", {0.1}, {0.4}, false, Scale::times}},
       &make_model<PreslidingHysteresis>},
  };
}

}  // namespace dynid::detail
