// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "dynid/effect/derived.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/simulation/effect_catalogue.hpp"

namespace dynid::detail {

/// What a joint-torque effect may look at: the true state, base to tip.
struct JointView {
  double t;                                    ///< [s]
  const Eigen::VectorXd &q, &dq, &tau;         ///< n each; tau: the joint torque that passes through
  const std::vector<Eigen::Isometry3d>& link;  ///< poses in the base frame, where needs_poses(t)
};

/// A motor mass behind a spring; rigid where stiffness is 0.
struct Transmission {
  double stiffness = 0.0;      ///< [N m/rad]
  double damping_ratio = 0.0;  ///< of the motor on its spring
  double motor_inertia = 0.0;  ///< [kg m^2]
  double gap = 0.0;            ///< [rad] of the dead zone, from end to end
};

/// Where an effect sits in the torque sensor's chain.
enum class SensorStage { none, command, gain, offset, saturation, delay };

/// An effect inside the plant: what it does not do, it leaves as it is. Nothing but the constructor and
/// change() may allocate or throw.
class EffectModel {
 public:
  virtual ~EffectModel() = default;

  /// Changes the rigid body.
  virtual void change(Robot&) const {}
  virtual bool changes_body() const { return false; }
  /// Adds a constant to the mass matrix.
  virtual void add_inertia(Eigen::MatrixXd&) const {}
  /// Puts a spring into a joint.
  virtual void transmission(std::vector<Transmission>&) const {}

  /// Leaves of the torques [N m] that the drives are asked for what they give.
  virtual bool limits_drives() const { return false; }
  virtual void drive(Eigen::VectorXd&) {}

  /// It adds joint torque, by torque().
  virtual bool acts() const { return false; }
  virtual bool needs_poses(double) const { return false; }
  /// Adds its torque [N m], positive where the motor has to work against it.
  virtual void add_torque(const JointView&, Eigen::VectorXd&) const {}
  /// Adds d torque / d dq [N m s/rad] and d torque / d q [N m/rad], or a bound of their size, at `dq`: for
  /// the choice of the step.
  virtual void add_slopes(const Eigen::VectorXd& /*dq*/, const Eigen::VectorXd& /*tau*/,
                          Eigen::VectorXd& /*damping*/, Eigen::VectorXd& /*stiffness*/) const {}
  /// Hidden state: at rest, then `h` seconds on at a velocity held.
  virtual void reset() {}
  virtual void advance(const Eigen::VectorXd& /*dq*/, double /*h*/) {}

  /// Adds (true position) - (position measured).
  virtual void add_encoder_offset(Eigen::VectorXd&) const {}
  virtual SensorStage stage() const { return SensorStage::none; }
  /// Passes the torque of instant `t`, later than any before, through its part of the sensor.
  virtual void sense(double /*t*/, Eigen::VectorXd& /*tau*/) {}
  virtual void reset_sensor(double /*t*/, const Eigen::VectorXd& /*tau*/) {}
};

/// What the plant makes of one effect, and from where it is drawn.
struct EffectDefinition {
  std::string name;
  std::vector<EffectDraw> draws;
  std::unique_ptr<EffectModel> (*make)(const Effect&, const Robot&);  ///< of a completed effect
  /// Draws what the ranges cannot say; may be null.
  void (*draw)(Effect&, const Robot&, std::mt19937_64&, double strength, double duration) = nullptr;
  /// Joints to draw carry at least this part of the largest gravity torque: elsewhere it would not be felt.
  double least_load = 0.0;
};

// The families, each in its file.
std::vector<EffectDefinition> rigid_body_effects();
std::vector<EffectDefinition> friction_effects();
std::vector<EffectDefinition> presliding_effects();
std::vector<EffectDefinition> thermal_effects();
std::vector<EffectDefinition> position_effects();
std::vector<EffectDefinition> sensor_effects();
std::vector<EffectDefinition> transmission_effects();
std::vector<EffectDefinition> coupling_effects();
std::vector<EffectDefinition> contact_effects();

/// All of them, family by family.
const std::vector<EffectDefinition>& effect_definitions();
const EffectDefinition& effect_definition(const std::string& name);

/// A parameter of a completed effect.
inline Eigen::VectorXd values(const Effect& effect, const char* key) {
  const std::vector<double>& v = effect.parameters.at(key);
  return Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
}
/// n numbers of a joint's own parameter that something else is divided by: 1 for joints that it is not of.
inline Eigen::VectorXd divisors(const Effect& effect, const char* key) {
  return values(effect, key).unaryExpr([](double x) { return x != 0.0 ? x : 1.0; });
}
inline double value(const Effect& effect, const char* key) { return effect.parameters.at(key).front(); }

template <class T>
std::unique_ptr<EffectModel> make_model(const Effect& effect, const Robot& robot) {
  return std::make_unique<T>(effect, robot);
}

using Scale = EffectDraw::Scale;

inline double uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Largest gravity torque [N m] of each joint over random poses within the limits.
Eigen::VectorXd gravity_peaks(const Robot& robot, std::mt19937_64& random);

/// Of the smoothing of sign(dq) that every dry friction has as a parameter.
inline EffectDraw velocity_scale() { return {"velocity_scale", {0.003}, {0.008}, false, Scale::none, true}; }

}  // namespace dynid::detail
