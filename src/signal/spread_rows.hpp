// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynid/signal/log.hpp"

namespace dynid::detail {

/// A few states of logs, spread along the motion. N x n, in the units of the log; motion comes from the
/// positions alone, by a cubic through a short window, so that it does not depend on how the log's velocity
/// is meant.
struct SpreadRows {
  Eigen::MatrixXd q, dq, ddq;
  Eigen::MatrixXd tau;        ///< smoothed alike; empty where a log has none
  Eigen::MatrixXd logged_dq;  ///< smoothed alike; empty where a log has none
  double interval = 0.0;      ///< median step of the stamps
};

/// About `count` rows, in an order whose every beginning is spread as well. Logs without time or shorter than
/// nine samples give none.
SpreadRows spread_rows(const std::vector<Log>& logs, Eigen::Index count);

}  // namespace dynid::detail
