// SPDX-License-Identifier: Apache-2.0
// Friction that is a function of the true velocity (and load) of a joint.
#include <cmath>

#include "effect_model.hpp"

namespace dynid::detail {
namespace {

/// d tanh(dq / v_s) / d dq.
double sign_slope(double dq, double scale) {
  const double s = std::tanh(dq / scale);
  return (1.0 - s * s) / scale;
}

class ViscousFriction : public EffectModel {
 public:
  ViscousFriction(const Effect& effect, const Robot&) : coefficient_(values(effect, "coefficient")) {}
  bool acts() const override { return true; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    tau.array() += coefficient_.array() * at.dq.array();
  }
  void add_slopes(const Eigen::VectorXd&, const Eigen::VectorXd&, Eigen::VectorXd& damping,
                  Eigen::VectorXd&) const override {
    damping += coefficient_;
  }

 private:
  Eigen::VectorXd coefficient_;
};

/// Coulomb friction of its own size in each direction; the same in both is plain Coulomb friction.
class CoulombFriction : public EffectModel {
 public:
  CoulombFriction(const Effect& effect, const Robot&)
      : forward_(values(effect, effect.name == "coulomb_friction" ? "coefficient" : "coefficient_positive")),
        back_(values(effect, effect.name == "coulomb_friction" ? "coefficient" : "coefficient_negative")),
        scale_(divisors(effect, "velocity_scale")) {}
  bool acts() const override { return true; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    for (Eigen::Index j = 0; j < tau.size(); ++j)
      if (forward_[j] != 0.0 || back_[j] != 0.0)
        tau[j] += (at.dq[j] > 0.0 ? forward_[j] : back_[j]) * std::tanh(at.dq[j] / scale_[j]);
  }
  void add_slopes(const Eigen::VectorXd& dq, const Eigen::VectorXd&, Eigen::VectorXd& damping,
                  Eigen::VectorXd&) const override {
    for (Eigen::Index j = 0; j < dq.size(); ++j)
      damping[j] += std::max(std::abs(forward_[j]), std::abs(back_[j])) * sign_slope(dq[j], scale_[j]);
  }

 private:
  Eigen::VectorXd forward_, back_, scale_;
};

class StribeckFriction : public EffectModel {
 public:
  StribeckFriction(const Effect& effect, const Robot&)
      : static_(values(effect, "static")),
        velocity_(values(effect, "stribeck_velocity")),
        exponent_(values(effect, "exponent")),
        scale_(divisors(effect, "velocity_scale")) {}
  bool acts() const override { return true; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    for (Eigen::Index j = 0; j < tau.size(); ++j) {
      if (static_[j] == 0.0) continue;
      const double x = std::abs(at.dq[j] / velocity_[j]);
      tau[j] += static_[j] * std::exp(-std::pow(x, exponent_[j])) * std::tanh(at.dq[j] / scale_[j]);
    }
  }
  void add_slopes(const Eigen::VectorXd& dq, const Eigen::VectorXd&, Eigen::VectorXd& damping,
                  Eigen::VectorXd&) const override {
    for (Eigen::Index j = 0; j < dq.size(); ++j)
      if (static_[j] != 0.0)
        damping[j] += std::abs(static_[j]) * (sign_slope(dq[j], scale_[j]) + 1.0 / velocity_[j]);
  }

 private:
  Eigen::VectorXd static_, velocity_, exponent_, scale_;
};

class LoadDependentFriction : public EffectModel {
 public:
  LoadDependentFriction(const Effect& effect, const Robot&)
      : coefficient_(values(effect, "coefficient")), scale_(divisors(effect, "velocity_scale")) {}
  bool acts() const override { return true; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    for (Eigen::Index j = 0; j < tau.size(); ++j)
      if (coefficient_[j] != 0.0)
        tau[j] += coefficient_[j] * std::abs(at.tau[j]) * std::tanh(at.dq[j] / scale_[j]);
  }
  void add_slopes(const Eigen::VectorXd& dq, const Eigen::VectorXd& tau, Eigen::VectorXd& damping,
                  Eigen::VectorXd&) const override {
    for (Eigen::Index j = 0; j < dq.size(); ++j)
      damping[j] += std::abs(coefficient_[j] * tau[j]) * sign_slope(dq[j], scale_[j]);
  }

 private:
  Eigen::VectorXd coefficient_, scale_;
};

}  // namespace

std::vector<EffectDefinition> friction_effects() {
  return {
      {"viscous_friction",
       {{"coefficient", {0.8}, {2.5}, false, Scale::times}},
       &make_model<ViscousFriction>},
      {"coulomb_friction",
       {{"coefficient", {0.6}, {2.0}, false, Scale::times}, velocity_scale()},
       &make_model<CoulombFriction>},
      {"asymmetric_coulomb_friction",
       {{"coefficient_positive", {1.0}, {2.2}, false, Scale::times},
        {"coefficient_negative", {0.1}, {0.6}, false, Scale::times},
        velocity_scale()},
       &make_model<CoulombFriction>},
      {"stribeck_friction",
       {{"static", {0.8}, {2.0}, false, Scale::times},
        {"stribeck_velocity", {0.1}, {0.4}, false, Scale::none},
        {"exponent", {1.0}, {2.0}, false, Scale::none},
        velocity_scale()},
       &make_model<StribeckFriction>},
      {"load_dependent_friction",
       {{"coefficient", {0.06}, {0.2}, false, Scale::times}, velocity_scale()},
       &make_model<LoadDependentFriction>,
       nullptr,
       0.05},
  };
}

}  // namespace dynid::detail
