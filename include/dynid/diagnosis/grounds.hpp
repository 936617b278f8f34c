// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace dynid {

/// What speaks for an effect of a set, in numbers without units: of these, weighted as a calibration says,
/// its probability is made. None depends on the size, the units or the labels of a robot.
enum class Ground : std::size_t {
  evidence,   ///< asinh of the log odds of the set with it, against the best without it or with another,
              ///< the form errors of all being noise
  unlike,     ///< log of the part of its energy that the best other in its place leaves
  transfer,   ///< energy that it takes where it was not fitted, per energy that it has there: 1 if true, 0 if
              ///< not
  rest,       ///< part of the gap (rms) of its own joints that the set leaves, where it was fitted
  rest_held,  ///< and where it was not
  share,      ///< log of its share of what the set explains
  above_form,   ///< log of its torque (rms) per form error of the others, on the joint where it is clearest
  above_floor,  ///< log of its torque (rms) per noise floor, on that joint
  company,      ///< log of the number of effects of the set
  approximate,  ///< 1 for an effect of approximate form
  window,       ///< 1 for one that acts in a window of time, or is bound to the clock of one log
};
constexpr std::size_t ground_count = 11;
/// As calibration files name them.
constexpr std::array<const char*, ground_count> ground_names = {
    "evidence",   "unlike",      "transfer", "rest",        "rest_held", "share",
    "above_form", "above_floor", "company",  "approximate", "window"};

/// Values of the grounds, in their order.
struct Grounds {
  std::array<double, ground_count> value{};
  double& operator[](Ground g) { return value[static_cast<std::size_t>(g)]; }
  double operator[](Ground g) const { return value[static_cast<std::size_t>(g)]; }
};

/// An effect that the search proposed and the judge weighed, whether it was named or not.
struct ConsideredEffect {
  std::string name;
  std::vector<int> joints;  ///< from 1
  double share = 0.0;       ///< of what the whole set explains
  Grounds grounds;
  double probability = 0.0;
};

}  // namespace dynid
