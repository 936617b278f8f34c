// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace dynid {

// Numbers as text, whatever the locale of the program: always with a decimal point, never grouped. None of
// these functions throws; infinities are `inf` and `-inf`, what is not a number is `nan`.

/// The shortest text from which the same double is read again.
std::string exact_number(double x);

/// `x` to `digits` significant digits, 1 to 17, without trailing zeros, as printf's %g: `0.25`, `1e-05`.
std::string short_number(double x, int digits = 6);

/// `x` with `decimals` digits, 0 to 17, behind the point, as printf's %f.
std::string fixed_number(double x, int decimals);

/// Reads all of `text` as a finite number (a leading + is allowed); false where it is not one, or does not
/// fit a double; `value` is then left alone.
bool parse_number(const std::string& text, double& value);

/// Numbers one after another, each to `digits` significant digits. `x`: anything with size() and operator[].
template <class Values>
std::string number_row(const Values& x, int digits = 4, const char* separator = "  ") {
  std::string row;
  for (decltype(x.size()) k = 0; k < x.size(); ++k)
    row += (k > 0 ? separator : "") + short_number(static_cast<double>(x[k]), digits);
  return row;
}

/// The same, each with `decimals` digits behind the point.
template <class Values>
std::string fixed_row(const Values& x, int decimals, const char* separator = "  ") {
  std::string row;
  for (decltype(x.size()) k = 0; k < x.size(); ++k)
    row += (k > 0 ? separator : "") + fixed_number(static_cast<double>(x[k]), decimals);
  return row;
}

}  // namespace dynid
