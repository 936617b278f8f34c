// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynid/diagnosis/hypothesis.hpp"

namespace dynid::detail {

/// The value that the effect has for joint `unit` (from 0); throws Error where it is missing.
double joint_value(const Robot& robot, const Effect& effect, const std::string& key, int unit);
/// The `size` numbers of a parameter of the whole arm; throws Error where it is missing or of another size.
Eigen::VectorXd arm_value(const Effect& effect, const std::string& key, int size);
/// The units that an effect of a model file stands for.
std::vector<int> units_of(const Hypothesis& h, const Robot& robot, const Effect& effect);

ColumnBlock all_channels(const std::vector<Eigen::MatrixXd>& columns);  ///< N x n each: one a coefficient

/// An effect that a joint has of its own, in its own torque, with parameters that are its coefficients times
/// `sign` and its shape parameters.
class OwnTorque : public Hypothesis {
 public:
  struct Coefficient {
    std::string key, unit;
  };
  OwnTorque(std::string name, std::vector<Coefficient> coefficients)
      : name_(std::move(name)), coefficients_(std::move(coefficients)) {}

  std::string name() const override { return name_; }
  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd& shape) const override {
    return {{unit}, {own(motion, unit, shape)}};
  }
  std::vector<NamedValue> parameters(const Robot& robot, int unit, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd& shape) const override;
  void restore(const Robot& robot, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override;

 protected:
  virtual Eigen::MatrixXd own(const GapMotion& motion, int joint, const Eigen::VectorXd& shape) const = 0;

 private:
  std::string name_;
  std::vector<Coefficient> coefficients_;
};

/// The width of the smoothed sign, which no parameter of the field describes: a shape parameter of every
/// Coulomb-like effect.
ShapeParameter sign_width();
/// The same on a joint of this scale.
ShapeParameter sign_width(const JointScale& scale);
/// tanh(dq / v_s) of a joint: N.
Eigen::VectorXd smooth_signs(const GapMotion& motion, int joint, double velocity_scale);

/// Of the time that a joint takes for its travel: no torque is later than that. A filter or a bus takes tens
/// of milliseconds whatever the arm, and a small arm sweeps in a third of a second.
constexpr double latest_of_sweep = 0.25;

/// Time constants of a drift, in parts of the log: sooner it is a transient, later it is straight.
constexpr double earliest_of_log = 0.06, latest_of_log = 1.2;

/// A speed at which joint `joint` (from 0) moves [rad/s or m/s]: half its limit, or, where there is none,
/// that of a pendulum as long as the arm.
double usual_speed(const Robot& robot, int joint);
/// [N m] by which the nominal model's friction hinders joint `joint` (from 0) at speed `speed` > 0, the mean
/// of both directions.
double nominal_friction(const Robot& robot, int joint, double speed);
/// The nominal model has no friction on any joint, neither as a parameter nor as an effect; no rotors.
bool without_friction(const Robot& nominal);
bool without_rotors(const Robot& nominal);
/// Prior of what every arm has, where the nominal model is made without it.
constexpr double of_what_all_have = 5.0;
/// Friction `torque` at `speed` beside the nominal model's still hinders the motion, but for a twentieth.
bool hinders(const Robot& robot, int joint, double speed, double torque);

}  // namespace dynid::detail
