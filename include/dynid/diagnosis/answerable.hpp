// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {

/// What one joint does in the logs. Units: those of joint_units() of its type.
struct JointExcitation {
  double travel = 0.0;  ///< [rad or m] largest less smallest position
  double speed = 0.0;   ///< [rad/s or m/s] largest
  double moving = 0.0;  ///< part of the time in which it is faster than a tenth of its rms speed
  int reversals = 0;    ///< of its direction, from motion to motion
  double load = 0.0;    ///< [N m or N] rms of what the model says it carries, friction left out
  double swing = 0.0;   ///< of that, the part that varies, rms over rms; 1: its mean is zero
};

/// Something that these logs cannot show, whatever the robot has.
struct Blindness {
  std::string name;  ///< joint_at_rest, no_reversal, one_speed, slow, steady_load, length, band, channel
  std::vector<int> joints;  ///< from 1; empty when it concerns the whole log
  std::string text;         ///< one sentence: what cannot be seen, and what would show it
};

/// Whether the logs can answer: what was recorded, and what could not be seen on it.
struct Answerable {
  double duration = 0.0;              ///< [s] of all logs
  double rate_hz = 0.0;               ///< of the slowest
  double band_hz = 0.0;               ///< looked at
  std::vector<std::string> channels;  ///< that every log has: `q`, `dq`, `tau`, ...
  std::vector<JointExcitation> joints;
  std::vector<Blindness> blind;
};

/// Below which a log cannot show something. Multiples of the joint's own limits and motion.
struct AnswerableCriteria {
  double least_travel = 0.02;  ///< of the joint's range: below it, it rests
  double at_rest = 0.1;        ///< of its rms speed
  int least_reversals = 2;     ///< below it, friction is a constant
  double least_spread = 2.0;   ///< 90 % over 10 % quantile of the speed in motion: below it, one speed
  double least_speed = 0.1;    ///< of the limit: below it, what grows with speed is small
  double least_swing = 0.1;    ///< of the load
};

/// `logs` as read and `prepared` as prepare() made them, with their segments; one robot's joints each. Does
/// not throw beyond Error of joint_scales(). Allocates.
Answerable can_answer(const Robot& nominal, const std::vector<Log>& logs,
                      const std::vector<PreparedLog>& prepared, const AnswerableCriteria& criteria = {});

}  // namespace dynid
