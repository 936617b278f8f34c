// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

namespace dynid {

/// One inequality h(p) >= 0 on the parameters p of eq. (27), links base to tip, ten a link in the order of
/// link_inertia.hpp: m, c_x, c_y, c_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz; SI units, c in the link frame, I
/// about the centre of mass in the axes of the link frame, the products of inertia tensor entries.
///
/// The callables are called from several threads at once. A value that is not finite counts as violated.
struct Inequality {
  std::function<double(const Eigen::VectorXd& p)> value;
  /// dh/dp over `variables`, in their order; empty: central differences of the fourth order.
  std::function<Eigen::VectorXd(const Eigen::VectorXd& p)> gradient;
  /// d2h/dp2 over `variables`; empty: differences of the gradient where that is given, of the value
  /// elsewhere.
  std::function<Eigen::MatrixXd(const Eigen::VectorXd& p)> hessian;
  /// Indices into p that h depends on; empty: all of them.
  std::vector<int> variables;
};

/// One way to satisfy a constraint: where every guard is >= 0, every requirement has to be.
struct Alternative {
  std::vector<Inequality> guards;  ///< where this alternative applies; empty: everywhere
  std::vector<Inequality> required;
};

/// A constraint satisfied by any one of its alternatives: one for a plain constraint, several for a
/// conditional one (if-else) or for a union of shapes.
struct Constraint {
  std::string name;
  std::vector<Alternative> alternatives;
  /// Where given, the margin itself; the alternatives then only describe its smooth pieces.
  std::function<double(const Eigen::VectorXd& p)> exact;
  bool enforced = true;  ///< false: its margin is reported, nothing more

  /// max over the alternatives that apply of the smallest requirement: >= 0 where satisfied; -infinity where
  /// none applies or a value is not finite. The exterior penalty of eq. (32) is -min(0, margin).
  double margin(const Eigen::VectorXd& p) const;
};

/// h(p) >= 0.
Constraint make_constraint(const std::string& name, Inequality h);

/// `condition` >= 0 ? `then` : `otherwise`; an empty `otherwise` asks for nothing there (the margin is then
/// -`condition`, by how much it does not apply). Either constraint
/// may itself be conditional.
Constraint make_conditional(const std::string& name, Inequality condition, const Constraint& then,
                            const Constraint& otherwise);

/// Every one of `parts`, as one constraint.
Constraint all_of(const std::string& name, const std::vector<Constraint>& parts);

/// At least one of `parts`.
Constraint any_of(const std::string& name, const std::vector<Constraint>& parts);

/// An arithmetic expression (muParser's syntax: `a > b ? c : d`, `sqrt`, `min`...) of `m1, c1x, c1y, c1z,
/// I1xx, I1xy, I1xz, I1yy, I1yz, I1zz, m2...` that must be >= 0. A choice `a > b ? c : d`  becomes a
/// conditional constraint, its pieces being known to the optimiser. Throws Error naming the constraint and
/// the fault where it does not parse or names something else than the parameters of `links` links.
Constraint make_expression(const std::string& name, const std::string& expression, int links);

/// Name of entry i of p: `m1`, `c1x`, `I1xx`...
std::string variable_name(int i);

}  // namespace dynid
