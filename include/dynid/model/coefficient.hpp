// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid {

/// One identified dynamic coefficient (base parameter), as it stands in a model file and in the JSON.
struct Coefficient {
  std::string name;          ///< leading parameter: `zz1`, `mx2`, `fv1`, `phi1_1`, `ia1`...
  std::string expression;    ///< what it groups: `yy2 + zz1`
  double value = 0.0;        ///< [SI: kg, kg m or kg m^2; friction as its law says]
  double std_percent = 0.0;  ///< 100 x standard deviation / |value|
  bool kept = true;  ///< false: pruned, its standard deviation being too large; the model does without it
};

/// A model as a file holds it: the robot and, where it was identified, the coefficients behind its
/// parameters.
struct ModelFile {
  Robot robot;
  std::vector<Coefficient> coefficients;  ///< empty when the model was not identified
  std::string note;                       ///< where the model comes from, in one line; may be empty
};

}  // namespace dynid
