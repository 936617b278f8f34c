// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "dynid/signal/log.hpp"

namespace dynid {

/// Something about the data that a person should know, found before anything is fitted.
struct DataIssue {
  std::string name;         ///< repeated_rows, jitter, gaps, short_segments, velocity_lag, velocity_gain,
                            ///< quantisation, saturation, constant_channel
  std::vector<int> joints;  ///< from 1; empty when it concerns the whole log
  double value = 0.0;
  std::string unit;
  std::string text;  ///< one sentence: what was found and what was done about it
};

/// What the checks found in one log.
struct DataReport {
  Eigen::Index samples = 0;  ///< rows of the log, repeats included
  double rate_hz = 0.0;      ///< 1 / median interval, repeats left out
  double duration = 0.0;     ///< [s]
  std::vector<DataIssue> issues;
  std::map<std::string, std::vector<std::string>> columns;  ///< as Log::columns
};

/// Where velocity and acceleration come from.
enum class MotionSource {
  automatic,  ///< whichever of the next two has less noise in the acceleration, just above the cut-off
  velocity,   ///< filtered once, acceleration differentiated once
  position,   ///< filtered once, differentiated twice
};

struct PrepareOptions {
  double cutoff = 0.0;  ///< [Hz] of the zero-phase Butterworth filter; 0: chosen by choose_cutoff()
  MotionSource source = MotionSource::automatic;
  bool mend_velocity_lag = true;  ///< shift dq back by the lag found between it and the derivative of q
  bool bridge_gaps = false;       ///< interpolate across gaps of any length: one segment
  /// [Hz] of Segment::speed, at most 0.4 times the log's rate; 0: none.
  double speed_cutoff = 0.0;
  bool thin = true;  ///< keep about 25 times the cut-off; false: the log's own rate or more
};

/// A stretch of the log without gaps, on a uniform grid.
struct Segment {
  double rate = 0.0;    ///< [Hz], about 25 times the cut-off where the log allows it
  Eigen::VectorXd t;    ///< [s] N
  Eigen::MatrixXd q;    ///< N x n, low-passed at the cut-off
  Eigen::MatrixXd dq;   ///< N x n
  Eigen::MatrixXd ddq;  ///< N x n
  /// N x n [rad/s], or empty: in a wider band, for what is not smooth in the velocity (friction at a reversal
  /// or in stick and slip), whose torque is to be low-passed after it is computed.
  Eigen::MatrixXd speed;
  Eigen::MatrixXd
      tau;  ///< N x n, only protected against aliasing: to be low-passed with the regressor's columns
};

/// A log ready for regression.
struct PreparedLog {
  std::string source;
  DataReport report;
  double cutoff = 0.0;           ///< [Hz]
  Eigen::VectorXd velocity_lag;  ///< [s] n: by which the logged dq came late; mended
  MotionSource motion = MotionSource::velocity;
  std::vector<Segment> segments;
};

/// Ten times the frequency that holds 99 % of the velocity's energy on the quickest joint, at most a sixth of
/// the sampling rate (above it, interpolation between samples is no longer to be trusted). [Hz]
double choose_cutoff(const Log& log);

/// Checks, mends, resamples, filters and differentiates one log: repeated rows dropped, gaps cut, dq
/// realigned with q. Throws Error naming the log when too little of it is usable. Memory: the log's own size
/// at most.
PreparedLog prepare(const Log& log, const PrepareOptions& options = {});

}  // namespace dynid
