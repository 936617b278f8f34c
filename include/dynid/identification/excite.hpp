// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "dynid/identification/base_parameters.hpp"
#include "dynid/identification/excite_collision.hpp"
#include "dynid/identification/exciting_motion.hpp"
#include "dynid/identification/triangular_factor.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {

/// What makes one motion better than another.
enum class ExcitationCriterion {
  condition,    ///< the condition number of the regressor, smaller
  determinant,  ///< the log-determinant of its information matrix, larger
};

/// Which columns and rows the regressor has.
struct RegressorOptions {
  bool friction = true;        ///< fv, fc, fo of eq. (24) for each joint, after the rigid body's columns
  bool rotor_inertia = false;  ///< reflected rotor inertias among the rigid body's columns
  Eigen::VectorXd weights;     ///< n [1/(N m)], one a joint, on its rows; empty: unweighted
};

struct ExciteOptions {
  MotionKind kind = MotionKind::fourier;
  ExcitationCriterion criterion = ExcitationCriterion::condition;
  RegressorOptions regressor;
  int harmonics = 5;         ///< L
  double duration = 21.0;    ///< [s], from rest to rest
  double base_period = 0.0;  ///< [s] of the series, 2 pi / w; 0: optimised. Starts of a `fourier` motion then
                             ///< have one period, or two, or a number between; a `ramped` one, one to three
  double ramp = 1.0;         ///< [s] of a ramped motion's start and end
  double margin = 0.05;  ///< share of every limit that is aimed to be left free (of half the range, for q)
  std::uint64_t seed = 1;
  int starts = 8;    ///< motions drawn; the best quarter is refined
  int effort = 300;  ///< evaluations a start; three times as many for those refined
  int threads = 0;   ///< 0: all cores; the result does not depend on it
  /// Called with the share done, 0..1, from any thread but never from two at once.
  std::function<void(double fraction)> progress;
};

/// How much of a limit a motion leaves.
struct LimitMargin {
  std::string name;  ///< position, velocity, acceleration, jerk, torque, self_collision, floor, box
  int joint = 0;     ///< from 1; 0 for the last three
  std::vector<std::string> between;  ///< the two that come nearest, for the last three
  double margin = 0.0;               ///< in `unit`; negative: the limit is broken
  double share = 0.0;  ///< of the limit (of half the range for position; of 0.1 m for the last three)
  std::string unit;
};

/// One start of the search.
struct ExciteRun {
  int start = 0;             ///< from 1
  double base_period = 0.0;  ///< [s]
  double criterion = 0.0;    ///< condition number, or log-determinant, of its motion
  bool feasible = false;     ///< every limit is kept
  int evaluations = 0;
};

struct Excitation {
  ExcitingMotion motion;
  bool feasible = false;          ///< every limit is kept, checked at 1 kHz
  double condition_number = 0.0;  ///< of the regressor at 200 Hz or more, with the exact sign(dq) in eq. (24)
  double log_determinant = 0.0;   ///< of its information matrix divided by the number of samples
  int columns = 0;                ///< of the regressor
  std::vector<LimitMargin> margins;  ///< only limits that exist
  int limiting = -1;            ///< index of the margin of the smallest share; -1 where there is no limit
  std::vector<ExciteRun> runs;  ///< in the order of their starts
};

/// Factor of the regressor along a motion: columns of `base`, then fv, fc, fo joint by joint (eq. (24), exact
/// sign); rows weighted. The right-hand side is zero. Throws Error on sizes that do not match.
TriangularFactor excitation_factor(const Robot& robot, const BaseParameters& base, const Trajectory& motion,
                                   const RegressorOptions& options = {});

/// Margins of every limit of the robot and of the collision model along a motion sampled at 1 kHz.
std::vector<LimitMargin> limit_margins(const Robot& robot, const CollisionModel& collision,
                                       const ExcitingMotion& motion);

/// Throws Error, naming joint or bodies and the limit, where no motion can keep the limits: position limits
/// that cross or leave no range, a limit that is not positive or lets a joint move by less than 0.01 rad (or
/// m) in the whole duration, a joint without position or velocity limit, bodies that are closer than the
/// clearance in each of a thousand poses drawn within the position limits, a pose held by no torque within
/// the limits likewise.
void check_limits(const Robot& robot, const CollisionModel& collision, const ExciteOptions& options);

/// A motion that excites the base parameters and friction as well as can be found within the limits of the
/// robot (position, velocity, acceleration, jerk; torque where the robot has inertial parameters) and of the
/// collision model. Local searches (NLopt's L-BFGS, exact gradients but for finite differences in q) from
/// several starts, over coefficients, offsets and base frequency, limits as a penalty that stiffens; the
/// result depends on the seed and the options alone. Throws Error as check_limits() and on options out of
/// range; where no start ends within the limits the result is the least bad and not `feasible`.
Excitation excite(const Robot& robot, const CollisionModel& collision = {},
                  const ExciteOptions& options = {});

}  // namespace dynid
