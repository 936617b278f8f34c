// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>

#include "dynid/model/robot.hpp"
#include "dynid/simulation/measurement.hpp"

namespace dynid {

struct PlantOptions {
  MeasurementOptions measurement;    ///< none by default: what is measured is what is
  unsigned long seed = 1;            ///< of the measurement noise
  double integration_rate = 4000.0;  ///< [Hz] at least; stiff effects take more steps by themselves
  /// The drive goes linearly from one torque command to the next during a step, as interpolating drives do;
  /// false: the command holds at once.
  bool interpolate_torque = true;
};

/// A robot to try things on: rigid body, rotor inertia and friction of eqs. (24), (25) of a Robot, and its
/// effects (Robot::effects, see effect_schemas()), in continuous time: by Runge-Kutta of order 4, and by
/// an implicit method of order 2 (SDIRK, L-stable) through instants at which friction is too stiff for it, as
/// on a light joint that stops, sticks or breaks away.
///
/// The joint torque tau obeys M(q) ddq + S dq + g + friction + effects = tau. Friction that jumps at zero
/// velocity (velocity_scale 0) is smoothed over a ten thousandth of the joint's speed (JointScale). With
/// joint_elasticity or backlash a joint has a motor mass of its own behind a spring: the drive's torque acts
/// on it, tau is what the spring passes on, and the encoder sits on the motor. What the electronics add comes
/// last, in this order: gain, offset, saturation and delay of the torque, then Measurement.
class Plant {
 public:
  /// Throws Error where validate() and complete_effect() do, when an effect makes a body impossible, and when
  /// a joint has no inertia at all.
  explicit Plant(const Robot& robot, const PlantOptions& options = {});
  ~Plant();
  Plant(Plant&&) noexcept;
  Plant& operator=(Plant&&) noexcept;

  int size() const noexcept;  ///< n

  /// Time 0 at the *measured* position q [rad] and velocity dq [rad/s] (an encoder_offset lies between it and
  /// the true one), with the joint torque tau [N m] already there (elastic joints are deflected by it). n
  /// each. Throws Error on another size or a value that is not finite.
  void reset(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& tau);
  /// The same under no torque.
  void reset(const Eigen::VectorXd& q, const Eigen::VectorXd& dq);

  /// Lets `dt` [s] pass under the torque command tau_cmd [N m] (n). Throws Error when the state is no longer
  /// finite, or dt is not positive. Does not allocate.
  void step(const Eigen::VectorXd& tau_cmd, double dt);

  /// Wrench of the surroundings on the tip: force [N] (0-2) and moment about the tip's origin [N m] (3-5), in
  /// the axes of the base or, with `tip_axes`, of the tip. It holds until it is set again, through reset()
  /// too; zero at first. Throws Error on a value that is not finite. Does not allocate.
  void set_tip_wrench(const Eigen::Matrix<double, 6, 1>& wrench, bool tip_axes = false);

  double time() const noexcept;  ///< [s]
  // True state, n each: the link side, base to tip.
  const Eigen::VectorXd& q() const noexcept;    ///< [rad]
  const Eigen::VectorXd& dq() const noexcept;   ///< [rad/s]
  const Eigen::VectorXd& ddq() const noexcept;  ///< [rad/s^2]
  const Eigen::VectorXd& tau() const noexcept;  ///< [N m] joint torque
  // What perfect encoders and torque sensors would give: motor side where a joint is elastic, encoder and
  // torque sensor with their effects, no quantisation and no noise.
  const Eigen::VectorXd& seen_q() const noexcept;
  const Eigen::VectorXd& seen_dq() const noexcept;
  const Eigen::VectorXd& seen_ddq() const noexcept;
  const Eigen::VectorXd& seen_tau() const noexcept;
  // What is measured.
  const Eigen::VectorXd& measured_q() const noexcept;
  const Eigen::VectorXd& measured_dq() const noexcept;
  const Eigen::VectorXd& measured_tau() const noexcept;

  /// Torque [N m] that each effect adds on the measured side at this instant: n x (number of effects), in the
  /// order of Robot::effects, written. Their sum is seen_tau() less the torque of the robot without effects
  /// along the seen motion, exactly (that of set_tip_wrench() is no effect: -J^T F is left over); an
  /// effect's own share is what it adds on top of those before it.
  void effect_torques(Eigen::MatrixXd& torques);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dynid
