// SPDX-License-Identifier: Apache-2.0
// presliding_hysteresis as LuGre friction (Canudas de Wit et al. 1995): a bristle that bends before it slips.
#include <cmath>

#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class PreslidingHysteresis : public EffectModel {
 public:
  PreslidingHysteresis(const Effect& effect, const Robot&)
      : coulomb_(values(effect, "coulomb")),
        stiffness_(values(effect, "stiffness")),
        damping_(values(effect, "damping")),
        bend_(Eigen::VectorXd::Zero(coulomb_.size())) {}
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
  return {{{"presliding_hysteresis",
            "LuGre friction: sigma0 z + sigma1 dz/dt, dz/dt = dq - sigma0 |dq| z / Fc",
            EffectScope::joints,
            {{"coulomb",
              "N m",
              "Fc, reached when it slips",
              true,
              {1.5},
              0.0,
              1000.0,
              {1.0},
              {3.0},
              false,
              Scale::times},
             {"stiffness",
              "N m/rad",
              "sigma0, of the bristle",
              true,
              {50.0},
              1e-3,
              1e6,
              {15.0},
              {100.0},
              false,
              Scale::times},
             {"damping",
              "N m s/rad",
              "sigma1, of the bristle",
              true,
              {0.3},
              0.0,
              1000.0,
              {0.1},
              {0.4},
              false,
              Scale::times}}},
           &make_model<PreslidingHysteresis>}};
}

}  // namespace dynid::detail
