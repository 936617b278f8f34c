// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/identification/identify.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/model/uncertainty.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// A model and a log of the free robot that, as a rule, it was not fitted to.
struct HeldOutLog {
  Robot robot;
  Log log;
  Eigen::Index lead = 0;  ///< first rows that only fill the filters
};

/// What the residual of the loop strays by, from the residuals themselves: every log is run through a
/// TorqueEstimator as it was recorded, row by row.
///
/// The clock: the period is the time between the rows over the periods that they were apart, where the motion
/// along the measured velocity comes in whole periods (half of the rows within a tenth of one), else none.
/// motion_bandwidth: of 25, 50, 100 and 200 1/s the one whose residuals have the smallest determinant of
/// their covariance. For each joint the coefficients of sigma^2 from the squares of the residual (nonnegative
/// least squares, weights iterated; a quarter of the mean stays constant, for states that the logs did not
/// visit); stiction_speed is a tenth of the joint's rms speed, sticking half the friction model's step
/// through it. The tail of the statistic: exponential above the 60 % quantile of its maxima over blocks of 8
/// / window seconds, its scale one standard deviation up, so that the alarms promised are an upper bound in
/// five of six cases.
///
/// Effects that the loop cannot compute are left out. Throws Error: no parts, robots of different sizes, a
/// log without t, dq or tau, less than 5 s of data, rows further apart than 10 ms.
Uncertainty learn_uncertainty(const std::vector<HeldOutLog>& parts);

/// Of an identified model: from the validation logs, if any; else from eighths of the logs, each predicted
/// by a model identified from the rest. `robot`: as given to identify(), whose centres of mass are the
/// contact points (the tip on the last link); `identified`: what it returned. Throws Error as identify() and
/// learn_uncertainty().
Uncertainty identify_uncertainty(const Robot& robot, const Robot& identified, const std::vector<Log>& logs,
                                 const std::vector<Log>& validation, const IdentifyOptions& options);

}  // namespace dynid
