// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// One way in which a log speaks another language than the model.
struct Convention {
  /// torque_sign, joint_sign, joint_order, joint_zero, position_unit, velocity_unit, torque_unit,
  /// torque_is_motor_side, torque_without_gravity, torque_is_magnitude, torque_is_current, gravity, time_unit
  std::string name;
  std::vector<int> joints;  ///< from 1; empty when it concerns the whole log
  double value = 0.0;       ///< sign, factor to SI, angle [rad]; for gravity its angle to the model's [rad]
  double explained_before =
      0.0;  ///< part of the torque's energy that the model explains as the log stands, mean
            ///< over the joints concerned; of the velocity's for velocity and time units
  double explained_after = 0.0;  ///< the same, read with all of the report's conventions
  std::string assume;            ///< `KEY=VALUE`, for parse_assumptions()
  std::string text;              ///< one sentence for a person
};

/// What find_conventions() found.
struct ConventionReport {
  std::vector<Convention> conventions;  ///< empty: the log means what the model takes it to mean
  std::string assume;                   ///< all of them, for parse_assumptions(); empty when there are none
  double explained = 0.0;               ///< by the model as the log stands, mean over the joints
  std::string runner_up;  ///< the next best reading, as a text for parse_assumptions(); may be empty
  double runner_up_explained = 0.0;
  /// Other readings, for parse_assumptions(), under which the model would have made the log say the same:
  /// what moves alike, as a mirror image, cannot be told apart.
  std::vector<std::string> equivalents;
  /// Nothing is found, but these readings would explain the log where the model as it stands does not, and so
  /// would a body that the arm carries, or one another: texts for parse_assumptions(), the best first.
  std::vector<std::string> undecided;
  /// One sentence on it, for a person; empty where there is none.
  std::string undecided_text;
};

struct ConventionOptions {
  int rows = 640;  ///< states looked at: some hundred tell readings apart, more only cost time

  // When it is a misreading.
  /// A reading is a misreading only when, on the joints that it concerns, the model explains less than
  /// `most_before` of the torque's energy as the log stands, more than `least_after` when read that way, and
  /// leaves at most 1 / `least_gain` of the residual: a payload, a wrong link or a tilt leaves much
  /// explained, and no other reading explains the rest.
  double most_before = 0.5;
  double least_after = 0.65;
  double least_gain = 6.0;
  /// Where a reading is as clear as this, more may be explained as the log stands: two zeros of a real arm,
  /// and a heavy payload that would stand for them, come to a half.
  double most_before_clear = 0.7;
  double least_after_clear = 0.9;
  double least_gain_clear = 10.0;
  /// The same for a robot of one joint, which has little to tell readings by: explained to within
  /// `model_error`.
  double least_after_alone = 0.97;
  double least_gain_alone = 20.0;
  double least_lead_alone = 1.0;  ///< of the best reading before the next, in the measure below
  /// A joint is counted by the evidence that the reading brings on it (see below), from here on.
  double least_weight = 0.3;
  /// Samples at a torque's own largest or smallest value, as part of all: from here on it is clipped, and the
  /// joint says nothing.
  double most_clipped = 0.02;

  // How readings are weighed: the sum over joints of log(what is left + model_error), and a cost each.
  double model_error =
      0.03;                ///< of a joint's energy: no nominal model is nearer, so a better fit says nothing
  double worst = 10.0;     ///< in the same measure: beyond it a worse fit says nothing either
  double read_well = 0.6;  ///< left of every joint's energy at most: nothing is sought
  /// Rotor inertia to believe, in multiples of the links' own about the joint: any more would hide every
  /// rigid body.
  double most_rotor = 100.0;
  /// Of what friction and rotor alone leave: where the body does not bring it below that on one joint, it is
  /// not seen at all, and any reading that makes its torque small would do.
  double least_part = 0.3;
  /// The same where the body is as good as a rotor, and only its size speaks for it: twice the model's error.
  double most_bare = 0.06;
  /// Left of every joint's energy at most: no more elaborate reading is tried, as none could be told to be
  /// better: the model's error.
  double settled = 0.03;
  /// Square of the correlation between a joint's torque and the model's, friction apart, from where on the
  /// factor of its unit is its own; below it is taken from the others'.
  double least_felt = 0.5;
  double dip = 0.05;          ///< of the largest torque, below zero: smoothed magnitudes dip where they turn
  double least_factor = 3.0;  ///< between a torque's gain, which is an effect, and a unit or side of a gear
  double least_mounting = 0.35;    ///< [rad] 20 deg, below it a tilt, which is an effect
  double snap_gravity = 0.14;      ///< [rad] 8 deg to an axis of the base: mountings are square
  double gravity_tolerance = 0.4;  ///< of its size, relative: a payload draws the fit away
  /// An equivalent reading is said where it is hardly less simple than the best one, in the same measure: a
  /// reading and another that no torque shows are equivalent too.
  double most_further = 0.5;
  double payload_cost = 1.0;     ///< of a payload beside a reading
  std::size_t tried_again = 16;  ///< best readings that are tried with a payload too
};

/// Asks whether logs mean what a model takes them to mean, before any effect is sought. At some hundred
/// states, with a free offset, Coulomb, viscous and rotor coefficient for each joint (friction and rotor
/// inertia not negative), it compares the torque that the nominal rigid body explains under each reading:
/// signs, order and zeros of joints, units, motor side, gravity; alone and the usual ones together.
///
/// `nominal`: the robot with its inertial parameters; its friction, rotor inertia and effects are not used.
/// Where all parameters are zero nothing is found. `logs`: as read, with t, q and tau, one convention for
/// all. Deterministic; uses the calling thread only. Throws Error on logs whose number of joints is not the
/// robot's.
ConventionReport find_conventions(const Robot& nominal, const std::vector<Log>& logs,
                                  const ConventionOptions& options = {});

/// How to read a log: what `--assume` says. Defaults change nothing.
struct Assumptions {
  std::vector<int> order;       ///< joint j (from 0) is the log's joint order[j]; empty: as they stand
  Eigen::VectorXd joint_sign;   ///< n, +-1: of position, velocity, acceleration and torque; empty: 1
  Eigen::VectorXd torque_sign;  ///< n, +-1: of the torque alone; empty: 1
  Eigen::VectorXd zero;         ///< n [rad or m], added to the position (after its sign); empty: 0
  double position_unit = 1.0;   ///< [rad] that one of the log's is, of revolute joints
  double velocity_unit = 1.0;   ///< [rad/s]
  bool velocity_from_position = false;     ///< the log's velocity is left out
  double time_unit = 1.0;                  ///< [s]
  Eigen::VectorXd torque_factor;           ///< n [N m] that one of the log's is; empty: 1
  bool without_gravity = false;            ///< the nominal gravity torque is added to the log's
  bool magnitude = false;                  ///< the log's torque gets the sign of the nominal's
  std::optional<Eigen::Vector3d> gravity;  ///< [m/s^2] in the base frame, in the model
  /// True when nothing is assumed.
  bool empty() const;
};

/// Reads `KEY=VALUE,...`. n: number of joints. The keys are the names of Convention:
/// `torque_sign=-1` or one sign for each joint, base to tip; `joint_sign=1,-1,...`; `joint_order=2,1,3`
/// (joint 1 is the log's second); `joint_zero=0,1.5708,...` [rad or m], added; `position_unit=deg|turn|rad`;
/// `velocity_unit=deg/s|rpm|rad/s|from_position` or a factor; `torque_unit=Nmm|Ncm|kgfcm|kgfm|lbfin|Nm` or a
/// factor; `torque_is_motor_side=` and `torque_is_current=` a factor, or one for each joint [N m per unit];
/// `torque_without_gravity=1`; `torque_is_magnitude=1`; `gravity=x,y,z` [m/s^2]; `time_unit=ms|us|ns|s`.
/// Throws Error naming the key and what is wrong with it.
Assumptions parse_assumptions(const std::string& text, int n);

/// The log read that way, in this order: time, order, units, signs, zeros, torque. `nominal` (after
/// apply_conventions(assumptions, robot)) gives gravity and signs where they are asked for. Throws Error
/// where the log's number of joints is another.
Log apply_conventions(const Assumptions& assumptions, const Robot& nominal, Log log);

/// The robot mounted as assumed: its gravity.
Robot apply_conventions(const Assumptions& assumptions, Robot robot);

}  // namespace dynid
