// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/model/robot.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {

struct RandomMotionOptions {
  double rate = 1000.0;           ///< [Hz] of the samples
  int harmonics = 5;              ///< of the Fourier series, at least 3
  double base_frequency = 0.075;  ///< [Hz], rounded so that the duration is a whole number of periods
  double margin = 0.9;            ///< part of every limit that is used
};

/// A random smooth motion: a Fourier series for each joint (supplement of Gaz et al. 2019, Section II) with
/// seeded coefficients, periodic, at rest with no acceleration at both ends, scaled into the limits of
/// position, velocity and acceleration (unknown ones: 0.8 of JointScale::travel about its middle,
/// JointScale::speed, and 6 times JointScale::acceleration). Obstacles,
/// self-collision and torque limits are not looked at: see excite.hpp for motions to run on a robot.
/// `duration` [s]. Throws Error on options out of range.
Trajectory random_motion(const Robot& robot, double duration, unsigned long seed,
                         const RandomMotionOptions& options = {});

}  // namespace dynid
