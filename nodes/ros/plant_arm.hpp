// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynid/model/robot.hpp"
#include "dynid/simulation/computed_torque.hpp"
#include "dynid/simulation/plant.hpp"
#include "ros/plant_reference.hpp"

namespace dynid {

struct PlantArmOptions {
  std::vector<Effect> effects;  ///< hidden: the controller does not know them
  double noise = 1.0;           ///< times the torque noise of a good robot, see MeasurementOptions::realistic
  double spread = 0.0;          ///< relative, of the true parameters around the model's: see perturbed()
  unsigned long seed = 1;       ///< of everything random
  double period = 1e-3;         ///< [s] of control and measurement
  double push_timeout = 1.0;    ///< [s] after which a push ends by itself
};

/// A simulated arm that behaves as one with a position controller: it holds its position under computed
/// torque with the nominal model, its drives no stronger than the joints' limits, follows motions, and is
/// pushed at its tip. One instant after the other by
/// step(); not safe to use from two threads at once.
class PlantArm {
 public:
  /// `model`: the nominal one, its own effects (Robot::effects) part of the true arm as well; `initial`: n
  /// [rad or m]. Throws Error where Plant, perturbed() and complete_effect() do.
  PlantArm(const Robot& model, const Eigen::VectorXd& initial, const PlantArmOptions& options);

  /// One period passes. Throws Error when the arm is lost: not finite, or 2 rad (or m) off its reference.
  /// Does not allocate otherwise.
  void step();

  /// See PlantReference::begin(): `motion` is exchanged for an older one, and begins `delay` [s] from now.
  void begin(Trajectory& motion, double delay) noexcept { reference_.begin(motion, time_ + delay); }
  void stop() noexcept { reference_.stop(time_); }
  /// Wrench on the tip from now on, see Plant::set_tip_wrench(); it comes and goes with a time constant of 5
  /// ms, and ends when nothing has renewed it for the time-out. Not finite: ignored.
  void push(const Eigen::Matrix<double, 6, 1>& wrench, bool tip_axes) noexcept;

  double time() const noexcept { return time_; }  ///< [s]
  const PlantReference& reference() const noexcept { return reference_; }
  const Plant& plant() const noexcept { return plant_; }  ///< what it measures, and what is true

 private:
  double period_, push_timeout_, push_ends_ = 0.0, time_ = 0.0;
  Plant plant_;
  ComputedTorque control_;
  PlantReference reference_;
  Eigen::VectorXd q_d_, dq_d_, ddq_d_, tau_, strongest_;
  Eigen::Matrix<double, 6, 1> push_ = Eigen::Matrix<double, 6, 1>::Zero(), applied_ = push_;
  bool tip_axes_ = false;
};

}  // namespace dynid
