// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <random>

#include "dynid/model/robot.hpp"

namespace dynid {

/// What a robot's electronics do to what is measured. All zero, the default: nothing. Positions and torques
/// are multiples of a joint's own range; times are those of the electronics, whatever the arm.
struct MeasurementOptions {
  /// [rad] quantum of q; of a prismatic joint this part of its travel (JointScale) for 2 pi. 0: none.
  double encoder_resolution = 0.0;
  double velocity_cutoff = 0.0;     ///< [Hz] of the first-order filter behind the difference of q; 0: true dq
  double white_noise = 0.0;         ///< standard deviation on the torque, of torque_ranges()
  double correlated_noise = 0.0;    ///< the same of a first-order Gauss-Markov process beside it
  double correlation_time = 0.15;   ///< [s] of that process
  double stamp_jitter = 0.0;        ///< [s] mean of the exponential lateness of a stamp
  double repeat_probability = 0.0;  ///< of a row that repeats the one before: its packet was lost

  /// A good robot: 2^20 counts a turn, velocity behind a 100 Hz filter (about 2 ms late), white noise of 1 in
  /// 1740 of the torque range and slow noise of 1 in 2900 (0.05 and 0.03 N m for a range of 87 N m) times
  /// `noise`, stamps 50 us late on average, 0.5 % lost.
  static MeasurementOptions realistic(double noise = 1.0);
  /// None of it.
  static MeasurementOptions clean() { return {}; }
};

/// Range [N m or N] of each joint's torque sensor, n: the geometric mean of its own torque limit and of the
/// largest among the arm's joints of the same type (a wrist's sensor is not as much finer as the wrist is
/// weaker). Where a limit is unknown, and by as much where the limits are above ten times what the arm
/// carries (JointScale), three times what the joint carries stands for it.
Eigen::VectorXd torque_ranges(const Robot& robot);

/// The encoders, drives and torque sensors of an arm: state of n channels.
class Measurement {
 public:
  /// Throws Error on an option that is negative or not finite.
  Measurement(const Robot& robot, const MeasurementOptions& options, unsigned long seed);

  /// The first sample: filters settle at it.
  void reset(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& tau);
  /// The next sample, `dt` [s] later. n values each; does not allocate.
  void update(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& tau, double dt);

  const Eigen::VectorXd& q() const noexcept { return q_; }      ///< n
  const Eigen::VectorXd& dq() const noexcept { return dq_; }    ///< n
  const Eigen::VectorXd& tau() const noexcept { return tau_; }  ///< n

 private:
  double quantised(Eigen::Index joint, double q) const noexcept;
  void measure_torque(const Eigen::VectorXd& tau, double forgetting);

  MeasurementOptions options_;
  Eigen::VectorXd scale_, quantum_;  // of the noise and of the position, joint by joint
  Eigen::VectorXd q_, dq_, tau_, slow_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace dynid
