// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "dynid/app/context.hpp"

namespace dynid {

/// Two or more diagnoses side by side: before and after a repair, Monday and Tuesday, robot A and robot B.
struct CompareJob {
  struct Entry {
    std::string name;  ///< what it is called: its file
    std::string json;  ///< as `dynid diagnose --json` writes it, format dynid-diagnosis-1
  };
  std::vector<Entry> diagnoses;  ///< in the order to compare them
};

/// A parameter of an effect in one diagnosis; of a joint's own, one number a joint.
struct ComparedParameter {
  std::string key, unit;
  Eigen::VectorXd value, low, high;  ///< 90 % interval
};

struct ComparedEffect {
  std::string name;
  std::vector<int> joints;  ///< from 1
  double probability = 0.0, share = 0.0;
  std::vector<ComparedParameter> parameters;
};

/// What of a diagnosis is compared.
struct ComparedDiagnosis {
  std::string name, verdict;
  Eigen::VectorXd rms, floor;     ///< gap and noise of each joint; empty where the logs could not be judged
  std::vector<std::string> unit;  ///< of the joints' torques
  std::optional<double> shrink;   ///< part of the gap that the effects take away; none where none was found
  std::vector<ComparedEffect> effects;
};

/// The same effect in several diagnoses.
struct EffectRow {
  std::string name;
  std::vector<std::optional<ComparedEffect>> in;  ///< one a diagnosis; none where it was not found
};

/// What is different from one diagnosis to the next.
struct Change {
  enum class Kind { verdict, gap, appeared, gone, changed };
  Kind kind = Kind::verdict;
  std::size_t to = 1;  ///< index of the later diagnosis
  std::string text;
};

struct CompareReport {
  std::vector<ComparedDiagnosis> diagnoses;
  std::vector<EffectRow> effects;
  std::vector<Change>
      changes;  ///< in the order of the diagnoses: verdict, effects, gaps; empty: nothing is different

  /// The page: needs nothing else, no script. `command`: what makes it again; `version`: of the program.
  std::string html(const std::string& command, const std::string& version) const;
};

/// Throws OptionError: two diagnoses or more.
void check_options(const CompareJob& job);

/// Allocates. Throws OptionError, Error naming the diagnosis that is none or is of another robot (number or
/// unit of joints); Stopped.
CompareReport run(const CompareJob& job, const Context& context = {});

}  // namespace dynid
