// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/diagnosis/diagnose.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// Where a model and a robot disagree, which effect makes it, and how far it shrinks.
struct DiagnoseJob {
  Robot nominal;
  std::vector<Log> logs;         ///< of several, the last only judges
  std::optional<Log> reference;  ///< of the healthy robot: the nominal model is fitted to it first
  /// `friction` or `payload` to take it out of the nominal model (to check the diagnosis), else the name of
  /// an effect to take out of the library.
  std::vector<std::string> withhold;
  /// How the logs (and the reference) are to be read: empty: as they stand, and asked whether they mean that;
  /// `auto`: as find_conventions() says; else a text for parse_assumptions(), which is not doubted.
  std::string assume;
  DiagnoseOptions options;  ///< its `progress` and `reading` are the job's; its `withhold` is added to
};

struct DiagnoseReport {
  Diagnosis diagnosis;
  Robot nominal;                  ///< that was compared, after `withhold` and `reference`
  std::vector<std::string> logs;  ///< their sources
  bool referenced = false;        ///< fitted to a healthy log first: view B

  bool succeeded() const {
    return diagnosis.verdict != Verdict::data_invalid && diagnosis.verdict != Verdict::misread;
  }
  /// The nominal model with the effects found in it, to write; there is one where effects were found.
  std::optional<ModelFile> patch() const;
  /// The page: see to_html(). `command` is what makes it again, for a person to read, `version` the
  /// program's.
  std::string html(const std::string& command, const std::string& version) const;
};

/// Throws OptionError: `cutoff` and `tolerance` not negative, `withhold` known. Does not look at robot and
/// logs.
void check_options(const DiagnoseJob& job);

/// Allocates; on all cores. Throws OptionError, Error as identify() and diagnose(), Stopped at the end of a
/// stage.
DiagnoseReport run(const DiagnoseJob& job, const Context& context = {});

/// Files and options of a diagnosis as a person names them.
struct DiagnoseCommand {
  std::string model, base, tip;
  std::vector<std::string> logs;
  std::string reference, topic;
  std::vector<std::string> withhold;
  std::string assume, calibration, gravity, columns;
  double rate = 0.0;
  double cutoff = 0.0;
  double tolerance = DiagnoseOptions().tolerance;
  unsigned seed = DiagnoseOptions().seed;
  std::string patch, next_trajectory, report;

  /// The line for a shell, `dynid diagnose ...`, words quoted where needed; what is empty or usual is left
  /// out. It stands in the report for a person to copy; no program runs it.
  std::string line() const;
};

}  // namespace dynid
