// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace dynid::detail {

// Figures as a page shows them, with typographic signs.

/// Three significant digits, or as `format` (printf's, of a double) says; a dash for what is not finite.
std::string page_number(double x, const char* format = "%.3g");
/// `12 %`, `<1 %`, `>99 %`.
std::string page_percent(double part);
/// `12 % to 15 %`, or one of them where they read alike.
std::string page_percents(double low, double high);
/// rad, or mrad where it is small.
std::string page_angle(double x);
/// `0.97`, `>0.99`, `<0.01`.
std::string page_probability(double p);
/// Colour of a badge, as the pages' style names it, for a verdict's word.
const char* verdict_tone(const std::string& verdict);
/// `joint 4`, `joints 2 and 4`; empty for all `of`.
std::string joints_in_words(const std::vector<int>& joints, Eigen::Index of);

}  // namespace dynid::detail
