// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynid/retrieval/constraint.hpp"
#include "local_task.hpp"
#include "prepared.hpp"

namespace dynid::detail {

/// Beyond it a bound is none: Ipopt's infinity is 1e19.
constexpr double unbounded = 1e20;
/// How far inside their bounds the unknowns keep, in units of Prepared::Units: rounding on the way back to p
/// must not leave them.
constexpr double strict_margin = 1e-8;

/// Columns and rows of the local problem: what does not depend on the point.
///
/// Columns: the unknowns x of Prepared; where the penalties of eq. (32) are stated by slacks ("elastic"), one
/// slack a link for eq. (16), one for eq. (30), one for each constraint of the user.
/// Rows: centres of mass in their box and total mass (linear); three pivots a link; the bounded entries of
/// the inertia about the centre of mass; the user's inequalities.
class LocalLayout {
 public:
  struct Linear {
    std::vector<int> columns;
    std::vector<double> values;
  };
  /// One inequality of the user.
  struct InequalityRow {
    const Inequality* h = nullptr;
    int slack = -1;          ///< its column; -1: hard
    std::vector<int> over;   ///< entries of p that it depends on
    std::vector<int> links;  ///< the links that these belong to, increasing
    double scale = 1.0;      ///< the row is h times this, to be about as steep as the others
  };

  /// `start` (p): where the optimiser starts. All arguments are the caller's and outlive the layout.
  LocalLayout(const Prepared& prepared, const LocalTask& task, const Eigen::VectorXd& start);

  int unknowns() const noexcept { return n_; }  ///< columns without the slacks
  int columns() const noexcept { return columns_; }
  int rows() const noexcept { return rows_; }
  bool consistency() const noexcept {
    return consistency_;
  }  ///< there are pivots, and the user's constraints
  bool elastic() const noexcept { return elastic_; }
  int triangle_slack(int link) const noexcept { return triangle_slack_ + link; }

  const std::vector<Linear>& linear() const noexcept { return linear_; }
  const std::vector<int>& inertia() const noexcept { return inertia_; }  ///< entries of p
  const std::vector<InequalityRow>& inequalities() const noexcept { return inequalities_; }
  /// Whether any row needs (m, c, I) of the links.
  bool needs_bodies() const noexcept { return !inertia_.empty() || !inequalities_.empty(); }

  /// Nonzeros of the Jacobian of the rows, in the order in which its values are given.
  const std::vector<int>& jacobian_rows() const noexcept { return jacobian_rows_; }
  const std::vector<int>& jacobian_columns() const noexcept { return jacobian_columns_; }

  const Eigen::VectorXd& start() const noexcept { return start_; }            ///< columns()
  const Eigen::VectorXd& slack_cost() const noexcept { return slack_cost_; }  ///< columns(); 0 for unknowns
  const std::vector<double>& row_low() const noexcept { return row_low_; }
  const std::vector<double>& row_high() const noexcept { return row_high_; }
  /// Bounds of the columns, columns() each.
  void column_bounds(double* low, double* high) const;

 private:
  void mark(int column);
  void end_row(double low, double high);
  void add_linear(Linear row, double low, double high);
  void add_centres_of_mass();
  void add_total_mass();
  void add_pivots();
  void add_inertia();
  void add_constraints(const Eigen::VectorXd& start);
  void add_inequality(const Inequality& h, int slack, const Eigen::VectorXd& start);
  void set_start(const Eigen::VectorXd& p);
  void set_triangle_start(int link);

  const Prepared& prepared_;
  const LocalTask& task_;
  int n_;
  bool consistency_, elastic_;
  int columns_ = 0, rows_ = 0;
  int triangle_slack_ = 0, total_slack_ = 0;
  Eigen::VectorXd low_, high_;  // of (m, c, I) of x
  Eigen::VectorXd start_, slack_cost_;
  std::vector<Linear> linear_;
  std::vector<int> inertia_;
  std::vector<InequalityRow> inequalities_;
  std::vector<double> row_low_, row_high_;
  std::vector<int> jacobian_rows_, jacobian_columns_;
};

/// dh / d(m, c, I of x), 10 n, at p: zero but in the links that h depends on.
Eigen::VectorXd scaled_gradient(const Prepared& prepared, const LocalLayout::InequalityRow& row,
                                const Eigen::VectorXd& p);

}  // namespace dynid::detail
