// SPDX-License-Identifier: Apache-2.0
#include "local.hpp"

#ifndef HAVE_CSTDDEF
#define HAVE_CSTDDEF  // Ipopt's headers leave it to the caller
#endif
#include <IpIpoptApplication.hpp>
#include <IpSolveStatistics.hpp>
#include <IpTNLP.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>

#include "differences.hpp"

namespace dynid::detail {

namespace {

using Ipopt::Index;
using Ipopt::Number;
using Matrix10 = Eigen::Matrix<double, 10, 10>;
using Vector10 = Eigen::Matrix<double, 10, 1>;

constexpr double unbounded = 1e20;          // Ipopt's infinity is 1e19
constexpr double strict = 1e-8;             // margin of the unknowns in units of Prepared::Units
constexpr double slack_room = 0.1;          // an interior point starts well inside
constexpr double inequality_margin = 1e-9;  // of the user's constraints, in their own unit

/// The pseudo-inertia with the mass first, [[m, h^T], [h, Sigma]], is the sum of x_j times these; entry 10 is
/// the direction of eq. (16)'s slack, Sigma + t 1.
const std::array<Eigen::Matrix4d, 11>& basis() {
  static const std::array<Eigen::Matrix4d, 11> matrices = [] {
    std::array<Eigen::Matrix4d, 11> made;
    for (int j = 0; j < 10; ++j) {
      const Eigen::Matrix4d P = pseudo_inertia(StandardParameters::Unit(j));
      Eigen::Matrix4d& E = made[static_cast<std::size_t>(j)];
      E(0, 0) = P(3, 3);
      E.block<3, 1>(1, 0) = P.block<3, 1>(0, 3);
      E.block<1, 3>(0, 1) = P.block<1, 3>(3, 0);
      E.block<3, 3>(1, 1) = P.block<3, 3>(0, 0);
    }
    made[10] = Eigen::Vector4d(0, 1, 1, 1).asDiagonal();
    return made;
  }();
  return matrices;
}

Eigen::Matrix4d pseudo(const Eigen::Ref<const Vector10>& x, double shift) {
  Eigen::Matrix4d P = shift * basis()[10];
  for (std::size_t j = 0; j < 10; ++j) P += x[static_cast<Eigen::Index>(j)] * basis()[j];
  return P;
}

/// Pivots d_1..d_3 of P beyond the mass, with first and second derivatives in the ten unknowns and the slack.
struct Pivots {
  std::array<double, 3> value;
  std::array<Eigen::Matrix<double, 11, 1>, 3> gradient;
  std::array<Eigen::Matrix<double, 11, 11>, 3> hessian;

  /// False where P is not positive definite: the pivots are then undefined.
  bool evaluate(const Eigen::Matrix4d& P, bool derivatives) {
    for (int k = 1; k < 4; ++k) {
      // d = v^T P v with v = (-P_kk^-1 p, 1): the derivative of v drops out of the first order.
      const Eigen::MatrixXd lead = P.topLeftCorner(k, k);
      const Eigen::LLT<Eigen::MatrixXd> llt(lead);
      if (llt.info() != Eigen::Success) return false;
      Eigen::VectorXd v(k + 1);
      v.head(k) = -llt.solve(P.block(0, k, k, 1));
      v[k] = 1.0;
      const auto slot = static_cast<std::size_t>(k - 1);
      value[slot] = P(k, k) + P.block(0, k, k, 1).col(0).dot(v.head(k));
      if (!derivatives) continue;
      Eigen::MatrixXd W(k, 11);
      for (int j = 0; j < 11; ++j) {
        const Eigen::VectorXd Ev = basis()[static_cast<std::size_t>(j)].topLeftCorner(k + 1, k + 1) * v;
        gradient[slot][j] = v.dot(Ev);
        W.col(j) = llt.matrixL().solve(Ev.head(k));
      }
      hessian[slot] = -2.0 * W.transpose() * W;
    }
    return true;
  }
};

/// d(m, c, I)/dx of one link.
Matrix10 link_jacobian(const Eigen::Ref<const Vector10>& x) {
  const double m = x[0];
  const Eigen::Vector3d h = x.segment<3>(1);
  Matrix10 J = Matrix10::Identity();
  J.block<3, 1>(1, 0) = -h / (m * m);
  J.block<3, 3>(1, 1) = Eigen::Matrix3d::Identity() / m;
  // I = J_o - (|h|^2 1 - h h^T)/m: column by column.
  for (int a = -1; a < 3; ++a) {
    Eigen::Matrix3d d;
    if (a < 0) {
      d = (h.squaredNorm() * Eigen::Matrix3d::Identity() - h * h.transpose()) / (m * m);
    } else {
      const Eigen::Vector3d e = Eigen::Vector3d::Unit(a);
      d = -(2.0 * h[a] * Eigen::Matrix3d::Identity() - e * h.transpose() - h * e.transpose()) / m;
    }
    StandardParameters column = StandardParameters::Zero();
    set_inertia_tensor(column, d);
    J.block<6, 1>(4, a + 1) = column.tail<6>();
  }
  return J;
}

/// sum_k weight_k d2(m, c, I)_k/dx2 of one link.
Matrix10 link_hessian(const Eigen::Ref<const Vector10>& x, const Eigen::Ref<const Vector10>& weight) {
  const double m = x[0];
  const Eigen::Vector3d h = x.segment<3>(1), c = weight.segment<3>(1);
  Matrix10 H = Matrix10::Zero();
  H.block<3, 1>(1, 0) = -c / (m * m);
  H(0, 0) = 2.0 * c.dot(h) / (m * m * m);
  // sum_k weight_k I_k holds -h^T B h / m.
  Eigen::Matrix3d B = -0.5 * inertia_tensor(weight);
  B(0, 0) = weight[6] + weight[9];
  B(1, 1) = weight[4] + weight[9];
  B(2, 2) = weight[4] + weight[6];
  H.block<3, 3>(1, 1) -= 2.0 / m * B;
  H.block<3, 1>(1, 0) += 2.0 / (m * m) * B * h;
  H(0, 0) -= 2.0 / (m * m * m) * h.dot(B * h);
  H.block<1, 3>(0, 1) = H.block<3, 1>(1, 0).transpose();
  return H;
}

/// One inequality of the user, as a row.
struct InequalityRow {
  const Inequality* h = nullptr;
  int slack = -1;  // column of its slack; -1: hard
  std::vector<int> over;
  std::vector<int> links;
  double scale = 1.0;
};

class Nlp : public Ipopt::TNLP {
 public:
  Nlp(const Prepared& prepared, const LocalTask& task, const Eigen::VectorXd& start)
      : prepared_(prepared), task_(task), n_(prepared.size()), consistency_(task.hard || task.xi > 0.0) {
    const Bounds& bounds = prepared.bounds();
    low_ = (bounds.lower - prepared.p_offset()).cwiseQuotient(prepared.p_scale());
    high_ = (bounds.upper - prepared.p_offset()).cwiseQuotient(prepared.p_scale());
    columns_ = n_;
    elastic_ = consistency_ && !task.hard;
    if (elastic_) {
      triangle_slack_ = columns_;
      columns_ += prepared.links();
      total_slack_ = columns_++;
    }
    add_rows(start);
    set_start(start);
  }

  const Eigen::VectorXd& x() const noexcept { return solution_; }

  bool get_nlp_info(Index& n, Index& m, Index& nnz_jac_g, Index& nnz_h_lag, IndexStyleEnum& style) override {
    n = columns_;
    m = rows_;
    nnz_jac_g = static_cast<Index>(jacobian_columns_.size());
    nnz_h_lag = n_ * (n_ + 1) / 2 + (elastic_ ? 11 * prepared_.links() : 0);
    style = C_STYLE;
    return true;
  }

  bool get_bounds_info(Index, Number* x_l, Number* x_u, Index, Number* g_l, Number* g_u) override {
    std::fill(x_l, x_l + n_, -unbounded);
    std::fill(x_u, x_u + n_, unbounded);
    for (int i = 0; i < n_; i += 10) {
      const bool fixed = high_[i] - low_[i] <= 4.0 * strict;
      x_l[i] = fixed ? 0.5 * (low_[i] + high_[i]) : std::max(low_[i], 0.0) + strict;
      x_u[i] = fixed ? x_l[i] : high_[i] - strict;
    }
    std::fill(x_l + n_, x_l + columns_, 0.0);
    std::fill(x_u + n_, x_u + columns_, unbounded);
    std::copy(row_low_.begin(), row_low_.end(), g_l);
    std::copy(row_high_.begin(), row_high_.end(), g_u);
    return true;
  }

  bool get_starting_point(Index, bool, Number* x, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy(start_.data(), start_.data() + start_.size(), x);
    return true;
  }

  bool eval_f(Index, const Number* x, bool, Number& f) override {
    const Eigen::Map<const Eigen::VectorXd> all(x, columns_);
    f = task_.scale * ((prepared_.A() * all.head(n_) - prepared_.b()).squaredNorm() + slack_cost_.dot(all));
    if (task_.prior_weight > 0.0) {
      const double distance = prior_distance(prepared_, all.head(n_));
      if (!std::isfinite(distance)) return false;
      f += task_.scale * task_.prior_weight * distance;
    }
    if (task_.pull > 0.0) f += task_.scale * task_.pull * (all.head(n_) - task_.towards).squaredNorm();
    return std::isfinite(f);
  }

  bool eval_grad_f(Index, const Number* x, bool, Number* gradient) override {
    const Eigen::Map<const Eigen::VectorXd> all(x, columns_);
    Eigen::Map<Eigen::VectorXd> g(gradient, columns_);
    g = slack_cost_;
    g.head(n_) += 2.0 * prepared_.A().transpose() * (prepared_.A() * all.head(n_) - prepared_.b());
    if (task_.prior_weight > 0.0) {
      Eigen::VectorXd of_prior;
      if (!std::isfinite(prior_distance(prepared_, all.head(n_), &of_prior))) return false;
      g.head(n_) += task_.prior_weight * of_prior;
    }
    if (task_.pull > 0.0) g.head(n_) += 2.0 * task_.pull * (all.head(n_) - task_.towards);
    g *= task_.scale;
    return g.allFinite();
  }

  bool eval_g(Index, const Number* x, bool, Index, Number* g) override {
    const Eigen::Map<const Eigen::VectorXd> all(x, columns_);
    int row = 0;
    for (const Linear& linear : linear_) {
      g[row] = 0.0;
      for (std::size_t k = 0; k < linear.columns.size(); ++k)
        g[row] += linear.values[k] * x[linear.columns[k]];
      ++row;
    }
    Pivots pivots;
    for (int i = 0; consistency_ && i < prepared_.links(); ++i) {
      if (!pivots.evaluate(shifted(all, i), false)) return false;
      for (const double value : pivots.value) g[row++] = value;
    }
    if (inertia_.empty() && inequalities_.empty()) return true;
    Eigen::VectorXd scaled(n_);
    for (int i = 0; i < n_; i += 10) {
      if (!(x[i] > 0.0)) return false;
      scaled.segment<10>(i) = stack({from_standard(StandardParameters(all.segment<10>(i)))});
    }
    for (const int index : inertia_) g[row++] = scaled[index];
    const Eigen::VectorXd p = to_p(scaled);
    for (const InequalityRow& inequality : inequalities_) {
      const double value = inequality.h->value(p);
      if (!std::isfinite(value)) return false;
      g[row++] = inequality.scale * (value + (inequality.slack < 0 ? 0.0 : x[inequality.slack]));
    }
    return true;
  }

  bool eval_jac_g(Index, const Number* x, bool, Index, Index nonzeros, Index* rows, Index* columns,
                  Number* values) override {
    if (values == nullptr) {
      std::copy(jacobian_rows_.begin(), jacobian_rows_.end(), rows);
      std::copy(jacobian_columns_.begin(), jacobian_columns_.end(), columns);
      return true;
    }
    const Eigen::Map<const Eigen::VectorXd> all(x, columns_);
    Number* out = values;
    for (const Linear& linear : linear_) out = std::copy(linear.values.begin(), linear.values.end(), out);
    Pivots pivots;
    for (int i = 0; consistency_ && i < prepared_.links(); ++i) {
      if (!pivots.evaluate(shifted(all, i), true)) return false;
      for (const auto& gradient : pivots.gradient)
        out = std::copy(gradient.data(), gradient.data() + (elastic_ ? 11 : 10), out);
    }
    if (!inertia_.empty() || !inequalities_.empty()) {
      std::vector<Matrix10> jacobians;
      Eigen::VectorXd scaled(n_);
      for (int i = 0; i < n_; i += 10) {
        if (!(x[i] > 0.0)) return false;
        jacobians.push_back(link_jacobian(all.segment<10>(i)));
        scaled.segment<10>(i) = stack({from_standard(StandardParameters(all.segment<10>(i)))});
      }
      for (const int index : inertia_) {
        const Vector10 row = jacobians[static_cast<std::size_t>(index / 10)].row(index % 10).transpose();
        out = std::copy(row.data(), row.data() + 10, out);
      }
      const Eigen::VectorXd p = to_p(scaled);
      for (const InequalityRow& inequality : inequalities_) {
        const Eigen::VectorXd full = scaled_gradient(inequality, p);
        for (const int i : inequality.links) {
          const Vector10 row = jacobians[static_cast<std::size_t>(i)].transpose() * full.segment<10>(10 * i) *
                               inequality.scale;
          out = std::copy(row.data(), row.data() + 10, out);
        }
        if (inequality.slack >= 0) *out++ = inequality.scale;
      }
    }
    return std::all_of(values, values + nonzeros, [](double v) { return std::isfinite(v); });
  }

  bool eval_h(Index, const Number* x, bool, Number factor, Index, const Number* lambda, bool, Index nonzeros,
              Index* rows, Index* columns, Number* values) override {
    if (values == nullptr) {
      Index* row = rows;
      Index* column = columns;
      for (int r = 0; r < n_; ++r)
        for (int c = 0; c <= r; ++c) {
          *row++ = r;
          *column++ = c;
        }
      for (int i = 0; elastic_ && i < prepared_.links(); ++i)
        for (int k = 0; k < 11; ++k) {
          *row++ = triangle_slack_ + i;
          *column++ = k < 10 ? 10 * i + k : triangle_slack_ + i;
        }
      return true;
    }
    const Eigen::Map<const Eigen::VectorXd> all(x, columns_);
    Eigen::MatrixXd H = 2.0 * prepared_.AtA();
    if (task_.prior_weight > 0.0) {
      Eigen::MatrixXd of_prior;
      if (!std::isfinite(prior_distance(prepared_, all.head(n_), nullptr, &of_prior))) return false;
      H += task_.prior_weight * of_prior;
    }
    H.diagonal().array() += 2.0 * task_.pull;
    H *= task_.scale * factor;
    Number* slack_block = values + n_ * (n_ + 1) / 2;
    const Number* multiplier = lambda + linear_.size();
    Pivots pivots;
    for (int i = 0; consistency_ && i < prepared_.links(); ++i) {
      if (!pivots.evaluate(shifted(all, i), true)) return false;
      Eigen::Matrix<double, 11, 11> sum = Eigen::Matrix<double, 11, 11>::Zero();
      for (const auto& hessian : pivots.hessian) sum += *multiplier++ * hessian;
      H.block<10, 10>(10 * i, 10 * i) += sum.topLeftCorner<10, 10>();
      if (elastic_) slack_block = std::copy(sum.col(10).data(), sum.col(10).data() + 11, slack_block);
    }
    if (!inertia_.empty() || !inequalities_.empty()) {
      Eigen::VectorXd weight = Eigen::VectorXd::Zero(n_);
      for (const int index : inertia_) weight[index] += *multiplier++;
      Eigen::VectorXd scaled(n_);
      std::vector<Matrix10> jacobians;
      for (int i = 0; i < n_; i += 10) {
        jacobians.push_back(link_jacobian(all.segment<10>(i)));
        scaled.segment<10>(i) = stack({from_standard(StandardParameters(all.segment<10>(i)))});
      }
      const Eigen::VectorXd p = to_p(scaled);
      for (const InequalityRow& inequality : inequalities_) {
        const double by = *multiplier++ * inequality.scale;
        if (by == 0.0) continue;
        weight += by * scaled_gradient(inequality, p);
        const Eigen::MatrixXd curvature = detail::hessian(*inequality.h, p);
        Eigen::MatrixXd J = Eigen::MatrixXd::Zero(curvature.rows(), n_);
        for (std::size_t k = 0; k < inequality.over.size(); ++k) {
          const int v = inequality.over[k], i = v / 10;
          J.block<1, 10>(static_cast<Eigen::Index>(k), 10 * i) =
              prepared_.p_scale()[v] * jacobians[static_cast<std::size_t>(i)].row(v % 10);
        }
        H += by * J.transpose() * curvature * J;
      }
      for (int i = 0; i < prepared_.links(); ++i)
        H.block<10, 10>(10 * i, 10 * i) += link_hessian(all.segment<10>(10 * i), weight.segment<10>(10 * i));
    }
    Number* out = values;
    for (int r = 0; r < n_; ++r)
      for (int c = 0; c <= r; ++c) *out++ = H(r, c);
    return std::all_of(values, values + nonzeros, [](double v) { return std::isfinite(v); });
  }

  bool intermediate_callback(Ipopt::AlgorithmMode, Index, Number, Number, Number, Number, Number, Number,
                             Number, Number, Index, const Ipopt::IpoptData*,
                             Ipopt::IpoptCalculatedQuantities*) override {
    return task_.stop == nullptr || !task_.stop->load(std::memory_order_relaxed);
  }

  void finalize_solution(Ipopt::SolverReturn, Index, const Number* x, const Number*, const Number*, Index,
                         const Number*, const Number*, Number, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    solution_ = Eigen::Map<const Eigen::VectorXd>(x, n_);
  }

 private:
  struct Linear {
    std::vector<int> columns;
    std::vector<double> values;
  };

  void add_linear(Linear row, double low, double high) {
    for (const int column : row.columns) mark(column);
    linear_.push_back(std::move(row));
    end_row(low, high);
  }
  void mark(int column) {
    jacobian_rows_.push_back(rows_);
    jacobian_columns_.push_back(column);
  }
  void end_row(double low, double high) {
    row_low_.push_back(low);
    row_high_.push_back(high);
    ++rows_;
  }

  void add_rows(const Eigen::VectorXd& start) {
    const Bounds& bounds = prepared_.bounds();
    const double margin = strict;
    for (int i = 0; i < n_; i += 10) {
      for (int a = 1; a < 4; ++a) {
        const double low = low_[i + a], high = high_[i + a];
        if (high - low <= 4.0 * margin) {  // as good as fixed
          add_linear({{i + a, i}, {1.0, -0.5 * (low + high)}}, 0.0, 0.0);
        } else {
          add_linear({{i + a, i}, {1.0, -low - margin}}, 0.0, unbounded);
          add_linear({{i + a, i}, {-1.0, high - margin}}, 0.0, unbounded);
        }
      }
    }
    if (consistency_) add_total_mass();
    for (int i = 0; consistency_ && i < prepared_.links(); ++i) {
      for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < 10; ++j) mark(10 * i + j);
        if (elastic_) mark(triangle_slack_ + i);
        end_row(0.0, unbounded);
      }
    }
    add_inertia();
    if (!consistency_) return;
    for (std::size_t k = 0; k < bounds.constraints.size(); ++k) {
      const int slack = elastic_ ? columns_++ : -1;
      const Alternative& chosen =
          bounds.constraints[k].alternatives[static_cast<std::size_t>(task_.alternatives[k])];
      for (const Inequality& guard : chosen.guards) add_inequality(guard, slack, start);
      for (const Inequality& required : chosen.required) add_inequality(required, slack, start);
    }
  }

  void add_total_mass() {
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
    const double margin = high - low <= 4.0 * strict * sum ? 0.0 : strict;
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

  void add_inertia() {
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
        if (high - low <= 4.0 * strict)
          end_row(0.5 * (low + high), 0.5 * (low + high));
        else
          end_row(low + strict, high - strict);
      }
    }
  }

  void add_inequality(const Inequality& h, int slack, const Eigen::VectorXd& start) {
    InequalityRow row;
    row.h = &h;
    row.slack = slack;
    row.over = variables(h, n_);
    for (const int index : row.over)
      if (row.links.empty() || row.links.back() != index / 10) row.links.push_back(index / 10);
    std::sort(row.links.begin(), row.links.end());
    row.links.erase(std::unique(row.links.begin(), row.links.end()), row.links.end());
    const double steepness = scaled_gradient(row, start).norm();
    if (std::isfinite(steepness) && steepness > 0.0) row.scale = std::clamp(1.0 / steepness, 1e-4, 10.0);
    for (const int i : row.links)
      for (int j = 0; j < 10; ++j) mark(10 * i + j);
    if (slack >= 0) mark(slack);
    end_row(row.scale * inequality_margin, unbounded);
    inequalities_.push_back(std::move(row));
  }

  /// dh/d(m, c, I of x), at p.
  Eigen::VectorXd scaled_gradient(const InequalityRow& row, const Eigen::VectorXd& p) const {
    Eigen::VectorXd full = Eigen::VectorXd::Zero(n_);
    const Eigen::VectorXd g = gradient(*row.h, p);
    for (std::size_t k = 0; k < row.over.size(); ++k)
      full[row.over[k]] = g[static_cast<Eigen::Index>(k)] * prepared_.p_scale()[row.over[k]];
    return full;
  }

  Eigen::VectorXd to_p(const Eigen::VectorXd& scaled) const {
    return scaled.cwiseProduct(prepared_.p_scale()) + prepared_.p_offset();
  }

  Eigen::Matrix4d shifted(const Eigen::Map<const Eigen::VectorXd>& all, int i) const {
    return pseudo(all.segment<10>(10 * i), (elastic_ ? all[triangle_slack_ + i] : 0.0) - strict);
  }

  void set_start(const Eigen::VectorXd& p) {
    start_ = Eigen::VectorXd::Zero(columns_);
    slack_cost_ = Eigen::VectorXd::Zero(columns_);
    start_.head(n_) = prepared_.to_x(p);
    for (int i = 0; consistency_ && i < prepared_.links(); ++i) {
      const auto x = start_.segment<10>(10 * i);
      const LinkInertia link = from_standard(StandardParameters(x));
      const double missing = 4.0 * strict - consistency_margins(link).triangle;
      if (elastic_) {
        const double scale = prepared_.p_scale()[10 * i + 4];
        start_[triangle_slack_ + i] = std::max(0.0, missing) * 1.1 + slack_room;
        slack_cost_[triangle_slack_ + i] = task_.xi * scale;
      } else if (missing > 0.0) {
        // Ipopt starts where the pivots are defined: add a little of a sphere.
        StandardParameters sphere = StandardParameters::Zero();
        set_inertia_tensor(sphere, 2.0 * (missing + strict) * Eigen::Matrix3d::Identity());
        start_.segment<10>(10 * i) += sphere;
      }
    }
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

  const Prepared& prepared_;
  const LocalTask& task_;
  int n_;
  bool consistency_, elastic_ = false;
  int columns_ = 0, rows_ = 0;
  int triangle_slack_ = 0, total_slack_ = 0;
  Eigen::VectorXd low_, high_;
  Eigen::VectorXd start_, slack_cost_, solution_;
  std::vector<Linear> linear_;
  std::vector<int> inertia_;
  std::vector<InequalityRow> inequalities_;
  std::vector<double> row_low_, row_high_;
  std::vector<int> jacobian_rows_, jacobian_columns_;
};

}  // namespace

LocalSolution solve_local(const Prepared& prepared, const Eigen::VectorXd& p, const LocalTask& task) {
  Ipopt::SmartPtr<Nlp> nlp = new Nlp(prepared, task, p);
  // MUMPS, the linear solver of Ipopt, keeps state in static variables: one solve at a time in a process.
  static std::mutex one_at_a_time;
  const std::lock_guard<std::mutex> lock(one_at_a_time);
  Ipopt::SmartPtr<Ipopt::IpoptApplication> ipopt = new Ipopt::IpoptApplication(false);
  const auto options = ipopt->Options();
  options->SetIntegerValue("print_level", 0);
  options->SetStringValue("sb", "yes");
  options->SetStringValue("nlp_scaling_method", "none");
  options->SetNumericValue("bound_relax_factor", 0.0);
  options->SetNumericValue("tol", 1e-7);
  options->SetNumericValue("constr_viol_tol", 1e-10);
  options->SetNumericValue("acceptable_tol", 1e-5);
  options->SetNumericValue("acceptable_constr_viol_tol", 1e-9);
  options->SetStringValue("mu_strategy", "monotone");
  options->SetIntegerValue("max_iter", 300);
  // A user's constraint may have a kink (a norm on its axis) that the barrier draws the iterates to.
  if (!prepared.bounds().constraints.empty()) options->SetNumericValue("barrier_tol_factor", 30.0);
  LocalSolution solution;
  solution.p = p;
  if (ipopt->Initialize("") != Ipopt::Solve_Succeeded) return solution;
  const Ipopt::ApplicationReturnStatus status =
      ipopt->OptimizeTNLP(Ipopt::SmartPtr<Ipopt::TNLP>(GetRawPtr(nlp)));
  solution.converged = status == Ipopt::Solve_Succeeded || status == Ipopt::Solved_To_Acceptable_Level;
  if (IsValid(ipopt->Statistics())) solution.iterations = ipopt->Statistics()->IterationCount();
  if (nlp->x().size() == 0 || !nlp->x().allFinite()) return solution;
  // Rounding aside the bounds hold; the penalised problem leaves to eq. (16) what it implies.
  const Eigen::VectorXd found = prepared.to_p(nlp->x());
  if (!found.allFinite()) return solution;
  solution.p = found.cwiseMax(prepared.bounds().lower).cwiseMin(prepared.bounds().upper);
  return solution;
}

double derivative_error(const Prepared& prepared, const Eigen::VectorXd& p, const LocalTask& task) {
  const Ipopt::SmartPtr<Nlp> nlp = new Nlp(prepared, task, p);
  Index n = 0, m = 0, jacobian_size = 0, hessian_size = 0;
  Ipopt::TNLP::IndexStyleEnum style{};
  nlp->get_nlp_info(n, m, jacobian_size, hessian_size, style);
  Eigen::VectorXd x(n);
  nlp->get_starting_point(n, true, x.data(), false, nullptr, nullptr, m, false, nullptr);
  std::vector<Index> rows(jacobian_size), columns(jacobian_size), h_rows(hessian_size),
      h_columns(hessian_size);
  std::vector<Number> values(jacobian_size), h_values(hessian_size);
  nlp->eval_jac_g(n, nullptr, true, m, jacobian_size, rows.data(), columns.data(), nullptr);
  nlp->eval_h(n, nullptr, true, 1.0, m, nullptr, true, hessian_size, h_rows.data(), h_columns.data(),
              nullptr);
  const Eigen::VectorXd lambda = Eigen::VectorXd::LinSpaced(m, -1.0, 2.0);
  double error = 0.0;
  const auto compare = [&error](const Eigen::VectorXd& given, const Eigen::VectorXd& differences) {
    const double scale = 1e-3 + given.cwiseAbs().maxCoeff();
    const double apart = (given - differences).cwiseAbs().maxCoeff() / scale;
    error = std::isfinite(apart) ? std::max(error, apart) : std::numeric_limits<double>::infinity();
  };
  // Gradient of the Lagrangian from first derivatives; its differences are the Hessian's columns.
  const auto first = [&](const Eigen::VectorXd& at, Eigen::VectorXd& objective, Eigen::MatrixXd& jacobian) {
    objective.resize(n);
    jacobian = Eigen::MatrixXd::Zero(m, n);
    nlp->eval_grad_f(n, at.data(), true, objective.data());
    nlp->eval_jac_g(n, at.data(), true, m, jacobian_size, nullptr, nullptr, values.data());
    for (std::size_t k = 0; k < values.size(); ++k) jacobian(rows[k], columns[k]) += values[k];
  };
  Eigen::VectorXd objective;
  Eigen::MatrixXd jacobian;
  first(x, objective, jacobian);
  nlp->eval_h(n, x.data(), true, 1.0, m, lambda.data(), true, hessian_size, nullptr, nullptr,
              h_values.data());
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t k = 0; k < h_values.size(); ++k) hessian(h_rows[k], h_columns[k]) += h_values[k];
  hessian = hessian.selfadjointView<Eigen::Lower>();
  constexpr double d = 1e-6;
  for (Index j = 0; j < n; ++j) {
    Eigen::VectorXd ahead = x, behind = x;
    ahead[j] += d;
    behind[j] -= d;
    double f_ahead = 0.0, f_behind = 0.0;
    nlp->eval_f(n, ahead.data(), true, f_ahead);
    nlp->eval_f(n, behind.data(), true, f_behind);
    error = std::max(error, std::abs(objective[j] - (f_ahead - f_behind) / (2 * d)) /
                                (1e-3 + objective.cwiseAbs().maxCoeff()));
    Eigen::VectorXd g_ahead(m), g_behind(m);
    nlp->eval_g(n, ahead.data(), true, m, g_ahead.data());
    nlp->eval_g(n, behind.data(), true, m, g_behind.data());
    compare(jacobian.col(j), (g_ahead - g_behind) / (2 * d));
    Eigen::VectorXd o_ahead, o_behind;
    Eigen::MatrixXd j_ahead, j_behind;
    first(ahead, o_ahead, j_ahead);
    first(behind, o_behind, j_behind);
    compare(hessian.col(j), (o_ahead - o_behind + (j_ahead - j_behind).transpose() * lambda) / (2 * d));
  }
  return error;
}

double prior_distance(const Prepared& prepared, const Eigen::VectorXd& x, Eigen::VectorXd* gradient,
                      Eigen::MatrixXd* hessian) {
  const Prior& prior = prepared.reference();
  const Eigen::VectorXd x0 = prepared.to_x(stack(prior.links));
  if (gradient) *gradient = Eigen::VectorXd::Zero(x.size());
  if (hessian) *hessian = Eigen::MatrixXd::Zero(x.size(), x.size());
  double sum = 0.0;
  for (int i = 0; i < prepared.links(); ++i) {
    const int at = 10 * i;
    if (prior.distance == PriorDistance::euclidean) {
      // In x every link is in its own units already; a scale given is per standard parameter about the
      // frame's origin, of which x is a linear function.
      const Prepared::Units& units = prepared.units()[static_cast<std::size_t>(i)];
      Matrix10 S = Matrix10::Identity();
      if (prior.scale.size() != 0) {
        Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
        pose.translation() = units.origin;
        StandardParameters unit = prepared.p_scale().segment<10>(at);
        unit.segment<3>(1) *= units.mass;
        S = prior.scale.segment<10>(at).asDiagonal() * transform_matrix(pose) * unit.asDiagonal();
      }
      const Vector10 difference = S * (x - x0).segment<10>(at);
      sum += difference.squaredNorm();
      if (gradient) gradient->segment<10>(at) = 2.0 * S.transpose() * difference;
      if (hessian) hessian->block<10, 10>(at, at) = 2.0 * S.transpose() * S;
      continue;
    }
    const Eigen::Matrix4d P = pseudo(x.segment<10>(at), 0.0);
    const Eigen::LLT<Eigen::Matrix4d> llt(P), llt0(pseudo(x0.segment<10>(at), 0.0));
    if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    const Eigen::Matrix4d inverse = llt.solve(Eigen::Matrix4d::Identity());
    const Eigen::Matrix4d inverse0 = llt0.solve(Eigen::Matrix4d::Identity());
    const double log_ratio = 2.0 * (llt0.matrixLLT().diagonal().array().log().sum() -
                                    llt.matrixLLT().diagonal().array().log().sum());
    sum += log_ratio + (P * inverse0).trace() - 4.0;
    for (int j = 0; (gradient || hessian) && j < 10; ++j) {
      const Eigen::Matrix4d& E = basis()[static_cast<std::size_t>(j)];
      if (gradient) (*gradient)[at + j] = (E * (inverse0 - inverse)).trace();
      if (!hessian) continue;
      const Eigen::Matrix4d around = inverse * E * inverse;
      for (int l = 0; l <= j; ++l)
        (*hessian)(at + j, at + l) = (*hessian)(at + l, at + j) =
            (around * basis()[static_cast<std::size_t>(l)]).trace();
    }
  }
  return sum;
}

}  // namespace dynid::detail
