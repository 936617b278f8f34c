// SPDX-License-Identifier: Apache-2.0
#include "local_layout.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "differences.hpp"

namespace dynid::detail {
namespace {

constexpr double slack_room = 0.1;          // an interior point starts well inside
constexpr double inequality_margin = 1e-9;  // of the user's constraints, in their own unit

bool as_good_as_fixed(double low, double high) { return high - low <= 4.0 * strict_margin; }

}  // namespace

LocalLayout::LocalLayout(const Prepared& prepared, const LocalTask& task, const Eigen::VectorXd& start)
    : prepared_(prepared),
      task_(task),
      n_(prepared.size()),
      consistency_(task.hard || task.xi > 0.0),
      elastic_(consistency_ && !task.hard),
      columns_(prepared.size()) {
  const Bounds& bounds = prepared.bounds();
  low_ = (bounds.lower - prepared.p_offset()).cwiseQuotient(prepared.p_scale());
  high_ = (bounds.upper - prepared.p_offset()).cwiseQuotient(prepared.p_scale());
  if (elastic_) {
    triangle_slack_ = columns_;
    columns_ += prepared.links();
    total_slack_ = columns_++;
  }
  add_centres_of_mass();
  if (consistency_) {
    add_total_mass();
    add_pivots();
  }
  add_inertia();
  if (consistency_) add_constraints(start);
  set_start(start);
}

void LocalLayout::column_bounds(double* low, double* high) const {
  std::fill(low, low + n_, -unbounded);
  std::fill(high, high + n_, unbounded);
  for (int i = 0; i < n_; i += 10) {
    const bool fixed = as_good_as_fixed(low_[i], high_[i]);
    low[i] = fixed ? 0.5 * (low_[i] + high_[i]) : std::max(low_[i], 0.0) + strict_margin;
    high[i] = fixed ? low[i] : high_[i] - strict_margin;
  }
  std::fill(low + n_, low + columns_, 0.0);
  std::fill(high + n_, high + columns_, unbounded);
}

void LocalLayout::mark(int column) {
  jacobian_rows_.push_back(rows_);
  jacobian_columns_.push_back(column);
}

void LocalLayout::end_row(double low, double high) {
  row_low_.push_back(low);
  row_high_.push_back(high);
  ++rows_;
}

void LocalLayout::add_linear(Linear row, double low, double high) {
  for (const int column : row.columns) mark(column);
  linear_.push_back(std::move(row));
  end_row(low, high);
}

void LocalLayout::add_centres_of_mass() {
  for (int i = 0; i < n_; i += 10) {
    for (int a = 1; a < 4; ++a) {
      const double low = low_[i + a], high = high_[i + a];
      if (as_good_as_fixed(low, high)) {
        add_linear({{i + a, i}, {1.0, -0.5 * (low + high)}}, 0.0, 0.0);
      } else {
        add_linear({{i + a, i}, {1.0, -low - strict_margin}}, 0.0, unbounded);
        add_linear({{i + a, i}, {-1.0, high - strict_margin}}, 0.0, unbounded);
      }
    }
  }
}

void LocalLayout::add_total_mass() {
  const Bounds& bounds = prepared_.bounds();
  Linear total;
  double sum = 0.0;
  for (int i = 0; i < n_; i += 10) {
    total.columns.push_back(i);
    total.values.push_back(prepared_.p_scale()[i]);
    sum += prepared_.p_scale()[i];
  }
  const double low = bounds.total_mass_lower, high = std::min(bounds.total_mass_upper, unbounded);
  for (double& value : total.values) value /= sum;
  const double margin = high - low <= 4.0 * strict_margin * sum ? 0.0 : strict_margin;
  if (!elastic_ && margin == 0.0) {
    add_linear(total, 0.5 * (low + high) / sum, 0.5 * (low + high) / sum);
    return;
  }
  Linear above = total, below = total;
  if (elastic_) {
    above.columns.push_back(total_slack_);
    above.values.push_back(1.0 / sum);
    below.columns.push_back(total_slack_);
    below.values.push_back(-1.0 / sum);
  }
  if (low > 0.0) add_linear(above, low / sum + margin, unbounded);
  if (high < unbounded) add_linear(below, -unbounded, high / sum - margin);
}

void LocalLayout::add_pivots() {
  for (int i = 0; i < prepared_.links(); ++i) {
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 10; ++j) mark(10 * i + j);
      if (elastic_) mark(triangle_slack_ + i);
      end_row(0.0, unbounded);
    }
  }
}

void LocalLayout::add_inertia() {
  // Eq. (16) bounds the inertia by itself: moments are >= 0 and products at most half the moment across.
  for (int i = 0; i < n_; i += 10) {
    for (int k = 4; k < 10; ++k) {
      const bool moment = k == 4 || k == 6 || k == 9;
      const double across = 0.5 * high_[i + (k == 5 ? 9 : (k == 7 ? 6 : 4))];
      const double low = low_[i + k], high = high_[i + k];
      const double implied_low = moment ? 0.0 : -across, implied_high = moment ? unbounded : across;
      if (consistency_ && low <= implied_low && high >= implied_high) continue;
      for (int j = 0; j < 10; ++j) mark(i + j);
      inertia_.push_back(i + k);
      if (as_good_as_fixed(low, high))
        end_row(0.5 * (low + high), 0.5 * (low + high));
      else
        end_row(low + strict_margin, high - strict_margin);
    }
  }
}

void LocalLayout::add_constraints(const Eigen::VectorXd& start) {
  const Bounds& bounds = prepared_.bounds();
  for (std::size_t k = 0; k < bounds.constraints.size(); ++k) {
    const int slack = elastic_ ? columns_++ : -1;
    const Alternative& chosen =
        bounds.constraints[k].alternatives[static_cast<std::size_t>(task_.alternatives[k])];
    for (const Inequality& guard : chosen.guards) add_inequality(guard, slack, start);
    for (const Inequality& required : chosen.required) add_inequality(required, slack, start);
  }
}

void LocalLayout::add_inequality(const Inequality& h, int slack, const Eigen::VectorXd& start) {
  InequalityRow row;
  row.h = &h;
  row.slack = slack;
  row.over = variables(h, n_);
  for (const int index : row.over)
    if (row.links.empty() || row.links.back() != index / 10) row.links.push_back(index / 10);
  std::sort(row.links.begin(), row.links.end());
  row.links.erase(std::unique(row.links.begin(), row.links.end()), row.links.end());
  const double steepness = scaled_gradient(prepared_, row, start).norm();
  if (std::isfinite(steepness) && steepness > 0.0) row.scale = std::clamp(1.0 / steepness, 1e-4, 10.0);
  for (const int i : row.links)
    for (int j = 0; j < 10; ++j) mark(10 * i + j);
  if (slack >= 0) mark(slack);
  end_row(row.scale * inequality_margin, unbounded);
  inequalities_.push_back(std::move(row));
}

void LocalLayout::set_triangle_start(int link) {
  const auto x = start_.segment<10>(10 * link);
  const double missing =
      4.0 * strict_margin - consistency_margins(from_standard(StandardParameters(x))).triangle;
  if (elastic_) {
    start_[triangle_slack(link)] = std::max(0.0, missing) * 1.1 + slack_room;
    slack_cost_[triangle_slack(link)] = task_.xi * prepared_.p_scale()[10 * link + 4];
  } else if (missing > 0.0) {
    // Ipopt starts where the pivots are defined: add a little of a sphere.
    StandardParameters sphere = StandardParameters::Zero();
    set_inertia_tensor(sphere, 2.0 * (missing + strict_margin) * Eigen::Matrix3d::Identity());
    start_.segment<10>(10 * link) += sphere;
  }
}

void LocalLayout::set_start(const Eigen::VectorXd& p) {
  start_ = Eigen::VectorXd::Zero(columns_);
  slack_cost_ = Eigen::VectorXd::Zero(columns_);
  start_.head(n_) = prepared_.to_x(p);
  for (int i = 0; consistency_ && i < prepared_.links(); ++i) set_triangle_start(i);
  if (!elastic_) return;
  slack_cost_.segment(total_slack_, columns_ - total_slack_).setConstant(task_.xi);
  double total = 0.0;
  for (int i = 0; i < n_; i += 10) total += p[i];
  const Bounds& bounds = prepared_.bounds();
  start_[total_slack_] = std::max({0.0, bounds.total_mass_lower - total, total - bounds.total_mass_upper});
  for (const InequalityRow& row : inequalities_) {
    const double value = row.h->value(p);
    if (std::isfinite(value)) start_[row.slack] = std::max(start_[row.slack], -value);
  }
}

Eigen::VectorXd scaled_gradient(const Prepared& prepared, const LocalLayout::InequalityRow& row,
                                const Eigen::VectorXd& p) {
  Eigen::VectorXd full = Eigen::VectorXd::Zero(prepared.size());
  const Eigen::VectorXd g = gradient(*row.h, p);
  for (std::size_t k = 0; k < row.over.size(); ++k)
    full[row.over[k]] = g[static_cast<Eigen::Index>(k)] * prepared.p_scale()[row.over[k]];
  return full;
}

}  // namespace dynid::detail
