// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid {

/// Unit strings of the quantities of one joint: those of a prismatic joint are not those of a revolute one.
struct JointUnits {
  std::string position, velocity, acceleration;  ///< `rad` or `m`, per second, per second squared
  std::string torque;                            ///< `N m` or `N`
  std::string torque_rate;                       ///< `N m/s` or `N/s`
  std::string stiffness;                         ///< torque per position: `N m/rad` or `N/m`
  std::string damping;                           ///< torque per velocity: `N m s/rad` or `N s/m`
  std::string inertia;                           ///< torque per acceleration: `kg m^2` or `kg`
  std::string per_position, per_velocity;        ///< `1/rad` or `1/m`, `s/rad` or `s/m`
};
/// The units of a joint of that type. Does not allocate after the first call.
const JointUnits& joint_units(JointType type);

/// The unit of a joint's quantity, given the one that it has on a revolute joint: `N m/rad` -> `N/m` for a
/// prismatic joint; itself for a revolute one, and where the unit has nothing to do with the joint (`s`, `1`,
/// `deg` ...).
std::string unit_for(JointType type, const std::string& unit_on_revolute);

/// How large the quantities of one joint are, so that a threshold or a drawn size can be a multiple of them.
/// Units: those of joint_units(type). All are positive and finite.
///
/// Laws: masses times k: torque, gravity, inertia times k and the rest the same. A change of the unit of
/// length, mass or time changes each by its dimension. Names and the order of calls do not matter.
struct JointScale {
  JointType type = JointType::revolute;
  /// What the joint carries: rms of inertial, centrifugal and gravity torque (no friction), along the motion
  /// or, from a model alone, of gravity over poses and of inertia times `acceleration`.
  double torque = 1.0;
  double gravity = 1.0;       ///< largest |g| over the motion or the poses; at least a millionth of `torque`
  double speed = 1.0;         ///< largest speed of the motion, or the limit
  double acceleration = 1.0;  ///< rms along the motion, or typical: 2 speed^2 / travel, or the limit if less
  double travel = 1.0;        ///< range of the positions of the motion, or between the limits
  double inertia = 1.0;       ///< median of M_jj with the rotor's
  double sampling = 0.0;      ///< [s] period of the samples; 0 from a model alone
  double recorded = 0.0;      ///< [s] that the motion takes, or the longest log; 0 from a model alone

  const JointUnits& units() const { return joint_units(type); }
  double stiffness() const noexcept { return torque / travel; }  ///< torque over the travel
  double damping() const noexcept { return torque / speed; }     ///< torque at the speed
  double duration() const noexcept { return travel / speed; }    ///< [s] of one sweep
  /// Size of a quantity by its unit, written for either type of joint (`N m s/rad`: damping()): 1 for `1`,
  /// `deg`. `s` is duration(). Throws Error on a unit that is not of a joint.
  double of(const std::string& unit) const;
};

/// [m] How far the arm reaches: the sum of the distances between its joints and to the last centre of mass or
/// the tip, whichever is farther. Of bodies about one point: the largest radius of gyration; without mass, 1.
double arm_reach(const Robot& robot);

/// Scales of every joint, base to tip, from the model alone: 512 poses within the limits, the same at every
/// call. Where a limit is unknown: travel is a turn, or arm_reach() for a prismatic joint; speed is that of a
/// pendulum as long as the reach, sqrt(|gravity| / reach) or sqrt(|gravity| reach). A joint that carries
/// nothing at all (no mass beyond it, no rotor) gets a millionth of the largest of the arm, by way of its own
/// acceleration. Throws Error where Model does. Allocates.
std::vector<JointScale> joint_scales(const Robot& robot);

/// The same along a motion: q, dq, ddq [rad, m; per s; per s^2], N x n, rows instants, columns joints base to
/// tip; `period` [s] between rows (0: unknown). `tau` [N m or N], N x n or empty: measured; used where the
/// model has nothing on a joint. A joint that does not move keeps speed, acceleration and travel of its
/// model-based scale, times a thousandth: no position or speed can be told apart finer. Of more than 2048
/// rows an even spread is used. Throws Error on sizes that do not match, no rows, or values that are not
/// finite. Allocates.
std::vector<JointScale> joint_scales(const Robot& robot, const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                     const Eigen::MatrixXd& ddq, const Eigen::MatrixXd& tau, double period);

}  // namespace dynid
