// SPDX-License-Identifier: Apache-2.0
#include "log_rows.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "dynid/base/error.hpp"

namespace dynid::detail {
namespace {

/// The narrowest band that a log asks for.
double common_cutoff(const std::vector<Log>& logs) {
  double cutoff = 0.0;
  for (const Log& log : logs) {
    const double own = choose_cutoff(log);
    cutoff = cutoff == 0.0 ? own : std::min(cutoff, own);
  }
  return cutoff;
}

}  // namespace

std::vector<RegressionRows> rows_of_logs(const Robot& robot, const BaseParameters& base,
                                         const std::vector<Log>& logs, const IdentifyOptions& options,
                                         double& cutoff, std::vector<PreparedLog>& reports) {
  std::vector<RegressionRows> rows;
  PrepareOptions prepare_options = options.prepare;
  if (cutoff == 0.0) cutoff = options.prepare.cutoff;
  if (cutoff == 0.0) cutoff = common_cutoff(logs);
  prepare_options.cutoff = cutoff;
  const auto say = [&](const std::string& stage) {
    if (options.progress) options.progress(stage, double(rows.size()) / double(logs.size()));
  };
  for (const Log& log : logs) {
    if (log.joints() != robot.size())
      throw Error(log.source + ": the log has " + std::to_string(log.joints()) + " joints, the robot has " +
                  std::to_string(robot.size()));
    say("filtering " + log.source);
    PreparedLog prepared = prepare(log, prepare_options);
    say("building the regressor");
    rows.emplace_back(robot, base, prepared);
    prepared.segments.clear();
    reports.push_back(std::move(prepared));
    say("building the regressor");
  }
  return rows;
}

}  // namespace dynid::detail
