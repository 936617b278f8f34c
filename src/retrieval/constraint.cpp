// SPDX-License-Identifier: Apache-2.0
#include "dynid/retrieval/constraint.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "differences.hpp"

namespace dynid {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

double smallest(const std::vector<Inequality>& inequalities, const Eigen::VectorXd& p) {
  double least = infinity;
  for (const Inequality& h : inequalities) {
    const double value = h.value(p);
    if (!std::isfinite(value)) return -infinity;
    least = std::min(least, value);
  }
  return least;
}

Inequality negated(const Inequality& h) {
  Inequality minus = h;
  minus.value = [value = h.value](const Eigen::VectorXd& p) { return -value(p); };
  if (h.gradient)
    minus.gradient = [gradient = h.gradient](const Eigen::VectorXd& p) -> Eigen::VectorXd {
      return -gradient(p);
    };
  if (h.hessian)
    minus.hessian = [hessian = h.hessian](const Eigen::VectorXd& p) -> Eigen::MatrixXd {
      return -hessian(p);
    };
  return minus;
}

void append(std::vector<Inequality>& to, const std::vector<Inequality>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

double Constraint::margin(const Eigen::VectorXd& p) const {
  if (exact) {
    const double value = exact(p);
    return std::isfinite(value) ? value : -infinity;
  }
  double best = -infinity;
  for (const Alternative& alternative : alternatives)
    if (smallest(alternative.guards, p) >= 0.0) best = std::max(best, smallest(alternative.required, p));
  return best;
}

Constraint make_constraint(const std::string& name, Inequality h) {
  return {name, {{{}, {std::move(h)}}}, {}, true};
}

Constraint make_conditional(const std::string& name, Inequality condition, const Constraint& then,
                            const Constraint& otherwise) {
  const Inequality opposite = negated(condition);
  Constraint both{name, {}, {}, true};
  for (const Alternative& alternative : then.alternatives) {
    both.alternatives.push_back(alternative);
    both.alternatives.back().guards.push_back(condition);
  }
  for (const Alternative& alternative : otherwise.alternatives) {
    both.alternatives.push_back(alternative);
    both.alternatives.back().guards.push_back(opposite);
  }
  if (otherwise.alternatives.empty()) both.alternatives.push_back({{opposite}, {}});
  both.exact = [condition = std::move(condition.value), then, otherwise](const Eigen::VectorXd& p) {
    const double applies = condition(p);
    if (applies >= 0.0) return then.margin(p);
    return otherwise.alternatives.empty() ? -applies : otherwise.margin(p);
  };
  return both;
}

Constraint all_of(const std::string& name, const std::vector<Constraint>& parts) {
  Constraint all{name, {{}}, {}, true};
  for (const Constraint& part : parts) {
    std::vector<Alternative> product;
    for (const Alternative& before : all.alternatives) {
      for (const Alternative& alternative : part.alternatives) {
        product.push_back(before);
        append(product.back().guards, alternative.guards);
        append(product.back().required, alternative.required);
      }
    }
    all.alternatives = std::move(product);
  }
  all.exact = [parts](const Eigen::VectorXd& p) {
    double least = infinity;
    for (const Constraint& part : parts) least = std::min(least, part.margin(p));
    return least;
  };
  return all;
}

Constraint any_of(const std::string& name, const std::vector<Constraint>& parts) {
  Constraint any{name, {}, {}, true};
  for (const Constraint& part : parts)
    any.alternatives.insert(any.alternatives.end(), part.alternatives.begin(), part.alternatives.end());
  any.exact = [parts](const Eigen::VectorXd& p) {
    double best = -infinity;
    for (const Constraint& part : parts) best = std::max(best, part.margin(p));
    return best;
  };
  return any;
}

std::string variable_name(int i) {
  static constexpr std::array<const char*, 10> suffixes = {"m",  "x",  "y",  "z",  "xx",
                                                           "xy", "yy", "xz", "yz", "zz"};
  const std::string link = std::to_string(i / 10 + 1);
  const int k = i % 10;
  if (k == 0) return "m" + link;
  return (k < 4 ? "c" : "I") + link + suffixes[static_cast<std::size_t>(k)];
}

namespace detail {

namespace {

// Differences are taken over this part of a parameter's size, or of what is usual for its kind (kg, m, kg
// m^2).
constexpr double relative_step = 1e-3;

double step(const Eigen::VectorXd& p, int i) {
  const int k = i % 10;
  const double usual = k == 0 ? 1.0 : (k < 4 ? 0.1 : 0.01);
  return relative_step * std::max(usual, std::abs(p[i]));
}

}  // namespace

std::vector<int> variables(const Inequality& h, int parameters) {
  if (!h.variables.empty()) return h.variables;
  std::vector<int> all(static_cast<std::size_t>(parameters));
  for (int i = 0; i < parameters; ++i) all[static_cast<std::size_t>(i)] = i;
  return all;
}

Eigen::VectorXd gradient(const Inequality& h, const Eigen::VectorXd& p) {
  if (h.gradient) return h.gradient(p);
  const std::vector<int> over = variables(h, static_cast<int>(p.size()));
  Eigen::VectorXd g(static_cast<Eigen::Index>(over.size()));
  Eigen::VectorXd moved = p;
  for (std::size_t k = 0; k < over.size(); ++k) {
    const int i = over[k];
    const double d = step(p, i);
    const auto at = [&](double by) {
      moved[i] = p[i] + by;
      return h.value(moved);
    };
    g[static_cast<Eigen::Index>(k)] = (8.0 * (at(d) - at(-d)) - (at(2 * d) - at(-2 * d))) / (12.0 * d);
    moved[i] = p[i];
  }
  return g;
}

Eigen::MatrixXd hessian(const Inequality& h, const Eigen::VectorXd& p) {
  if (h.hessian) return h.hessian(p);
  const std::vector<int> over = variables(h, static_cast<int>(p.size()));
  const auto count = static_cast<Eigen::Index>(over.size());
  Eigen::MatrixXd H(count, count);
  Eigen::VectorXd moved = p;
  if (h.gradient) {
    for (Eigen::Index k = 0; k < count; ++k) {
      const int i = over[static_cast<std::size_t>(k)];
      const double d = step(p, i);
      moved[i] = p[i] + d;
      const Eigen::VectorXd ahead = h.gradient(moved);
      moved[i] = p[i] - d;
      H.col(k) = (ahead - h.gradient(moved)) / (2.0 * d);
      moved[i] = p[i];
    }
    return 0.5 * (H + H.transpose()).eval();
  }
  const double here = h.value(p);
  for (Eigen::Index k = 0; k < count; ++k) {
    const int i = over[static_cast<std::size_t>(k)];
    const double di = step(p, i);
    const auto along = [&](double by) {
      moved[i] = p[i] + by;
      const double value = h.value(moved);
      moved[i] = p[i];
      return value;
    };
    H(k, k) = (along(di) - 2.0 * here + along(-di)) / (di * di);
    for (Eigen::Index l = 0; l < k; ++l) {
      const int j = over[static_cast<std::size_t>(l)];
      const double dj = step(p, j);
      const auto at = [&](double a, double b) {
        moved[i] = p[i] + a;
        moved[j] = p[j] + b;
        const double value = h.value(moved);
        moved[i] = p[i];
        moved[j] = p[j];
        return value;
      };
      H(k, l) = H(l, k) = (at(di, dj) - at(di, -dj) - at(-di, dj) + at(-di, -dj)) / (4.0 * di * dj);
    }
  }
  return H;
}

}  // namespace detail

}  // namespace dynid
