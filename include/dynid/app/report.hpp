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

/// The diagnosis as one HTML page that needs nothing else: well-formed XML, no network, for light and dark
/// schemes, any width, keyboard and screen reader. Its script draws the plots, of data in the page (thinned
/// to what can be seen, so that the page of a long log stays small); without scripts and in print they are
/// gnuplot's. Where one of the two is missing the page stands without it, and says so where it has no plots.
/// Allocates; does not throw beyond std::bad_alloc.
std::string to_html(const Diagnosis& diagnosis, const ReportContext& context);

}  // namespace dynid
