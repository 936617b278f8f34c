// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dynid/app/compare.hpp"
#include "dynid/app/context.hpp"
#include "dynid/app/diagnose.hpp"

namespace dynid {

/// A robot of a fleet and its logs.
struct FleetMember {
  std::string robot;
  std::vector<std::string> logs;  ///< paths; of several, the last only judges
};

/// Reads a fleet's table: CSV (comma, semicolon or tab) whose header names a column `robot` and columns
/// `log`, `log2`, `log3`...; an empty field is no log; lines that start with `#` are skipped; relative paths
/// are from the table's own folder. Throws Error naming file and line: a column of another name, a row
/// without robot or log, a robot named twice, no row.
std::vector<FleetMember> read_fleet(const std::string& path);

/// One model, many robots' logs.
struct FleetJob {
  std::vector<FleetMember> members;
  DiagnoseJob each;                             ///< of every diagnosis: all but the logs
  std::function<Log(const std::string&)> read;  ///< a log; called from several threads; throws Error
  /// Where each diagnosis is kept as soon as it is made, to be taken from there by the next run with the same
  /// logs and `inputs`; empty: nowhere. It is made where it is missing.
  std::string folder;
  std::string inputs;  ///< names what a diagnosis depends on beside the logs: model, options, version
  /// Of several processes, each does every `ranks`-th member from `rank` on, and `gather` then gives all of
  /// them what the others made (one text a member, empty where it was not one's own).
  int rank = 0, ranks = 1;
  std::function<void(std::vector<std::string>&)> gather;
};

/// What a robot's logs gave.
struct FleetEntry {
  FleetMember member;
  std::string error;            ///< why there is no diagnosis; else empty
  std::string json;             ///< the diagnosis, dynid-diagnosis-1, without the seconds that it took
  ComparedDiagnosis diagnosis;  ///< what of it the page shows
  /// Root mean square over the joints of the gap in units of what is of no account: 1 is as large as that.
  double gap = 0.0;
};

/// Robots with the same effects.
struct FleetCause {
  std::vector<std::string> effects;  ///< names, by the alphabet; empty: none was named
  std::string verdict;               ///< where none was named
  std::vector<std::size_t> entries;  ///< of FleetReport::entries
};

struct FleetReport {
  std::vector<FleetEntry>
      entries;  ///< largest gap first; those without a diagnosis last, in the table's order
  std::vector<FleetCause> causes;  ///< most robots first

  /// Every robot has a diagnosis.
  bool succeeded() const;
  /// The page: needs nothing else, no script. `command`: what makes it again; `version`: of the program.
  std::string html(const std::string& command, const std::string& version) const;
};

/// Throws OptionError as for a diagnosis, and where the fleet is empty.
void check_options(const FleetJob& job);

/// Shares the robots over all cores. A robot whose logs cannot be read or diagnosed is named with the reason,
/// and the others are done. Throws OptionError, Stopped; Error where the folder cannot be written. The result
/// does not depend on threads, ranks, or on what was taken from the folder.
FleetReport run(const FleetJob& job, const Context& context = {});

}  // namespace dynid
