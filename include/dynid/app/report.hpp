// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"

namespace dynid {

/// What a report says beside the diagnosis.
struct ReportContext {
  std::string robot;              ///< its name
  std::vector<std::string> logs;  ///< as the user named them
  std::string command;            ///< that makes it again
  std::string version;            ///< of the program
  bool referenced = false;        ///< the nominal model was fitted to a healthy log first
};

/// The diagnosis in one sentence, for a person.
std::string verdict_sentence(const Diagnosis& diagnosis);

/// The diagnosis as one HTML page that needs nothing else: well-formed XML, no script, no network, for light
/// and dark schemes and any width. Plots are gnuplot's, inlined; where it is missing the page says so and
/// stands without them. Allocates; does not throw beyond std::bad_alloc.
std::string to_html(const Diagnosis& diagnosis, const ReportContext& context);

}  // namespace dynid
