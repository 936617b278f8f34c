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
};

/// What the residual of the loop strays by, from the residuals themselves: every log is run through a
/// TorqueEstimator as it was recorded, row by row.
///
/// For each joint: momentum_noise, the mean of sigma^2 and correlation_time from the variances of windows of
/// five lengths (nonnegative least squares, relative; the time by a grid); the coefficients of sigma^2 from
/// the squares of the slow window (nonnegative least squares, weights iterated; a quarter of the mean stays
/// constant, for states that the logs did not visit). sticking is half the friction model's step through
/// stiction_speed. The tail of every window's statistic: exponential above the 60 % quantile of maxima over
/// blocks of four time constants, its scale one standard deviation up.
///
/// Effects that the loop cannot compute are left out. Throws Error: no parts, robots of different sizes, a
/// log without t, dq or tau, less than 5 s of data, rows further apart than 10 ms.
Uncertainty learn_uncertainty(const std::vector<HeldOutLog>& parts);

/// Of an identified model: from the validation logs, if any; else from quarters of the logs, each predicted
/// by a model identified from the rest. `robot`: as given to identify(), whose centres of mass are the
/// contact points (the tip on the last link); `identified`: what it returned. Throws Error as identify() and
/// learn_uncertainty().
Uncertainty identify_uncertainty(const Robot& robot, const Robot& identified, const std::vector<Log>& logs,
                                 const std::vector<Log>& validation, const IdentifyOptions& options);

}  // namespace dynid
