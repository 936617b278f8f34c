// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "dynid/retrieval/constraint.hpp"

namespace dynid {

/// What may be assumed of the parameters: LB <= p <= UB of Algorithm 1, eq. (30) and the constraints of the
/// user. Eqs. (11) and (16) hold always and stand nowhere here.
struct Bounds {
  Eigen::VectorXd lower;  ///< LB, 10 n, in the order of Inequality: kg, m, kg m^2 about the centre of mass
  Eigen::VectorXd upper;  ///< UB
  double total_mass_lower = 0.0;                                      ///< m_rob,min [kg]
  double total_mass_upper = std::numeric_limits<double>::infinity();  ///< m_rob,max [kg]
  std::vector<Constraint> constraints;
  std::string source;  ///< file the bounds came from, for messages; may be empty

  int links() const noexcept { return static_cast<int>(lower.size() / 10); }
};

/// Reads `format: dynid-bounds-1` (see docs/retrieval.md for its keys). Strict: throws Error naming the file,
/// the line and the key for an unknown or missing key, crossed or non-finite bounds, an expression that does
/// not parse or names an unknown variable, a mesh that cannot be read.
Bounds read_bounds(const std::string& path);

/// Throws Error naming the rule broken where no body can satisfy the bounds, before anything is optimised:
/// sizes, crossed bounds, a negative mass, a total mass out of reach of the masses, inertias that contradict
/// eq. (16).
void validate(const Bounds& bounds);

}  // namespace dynid
