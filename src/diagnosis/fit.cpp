// SPDX-License-Identifier: Apache-2.0
#include "fit.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace dynid::detail {
namespace {

constexpr int order = 4;       // of the autoregression
constexpr int iterations = 3;  // of noise and coefficients
// An autoregression can take any smooth gap for noise of its own colour. What speaks against it is its size:
// half the evidence is the likelihood of innovations, half that of the residual itself, with room for
// coloured noise of this many times the white floor.
constexpr double own_size = 0.5, room = 3.0;

/// Yule-Walker: biased autocovariances over the parts, hence always stable.
ChannelNoise estimate(const GapRows& rows, const Eigen::VectorXd& e) {
  Eigen::VectorXd r = Eigen::VectorXd::Zero(order + 1);
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
    const Eigen::Index size = rows.parts[p + 1] - rows.parts[p];
    const auto x = e.segment(rows.parts[p], size);
    for (int k = 0; k <= order && k < size; ++k) r[k] += x.head(size - k).dot(x.tail(size - k));
  }
  ChannelNoise noise;
  Eigen::MatrixXd R(order, order);
  for (int i = 0; i < order; ++i)
    for (int k = 0; k < order; ++k) R(i, k) = r[std::abs(i - k)];
  R.diagonal().array() += 1e-9 * r[0] + 1e-30;
  noise.ar = R.ldlt().solve(r.tail(order));
  noise.variance = 1.0;
  const Eigen::MatrixXd w = whitened(rows, e, noise);
  noise.variance = w.squaredNorm() / double(w.rows()) + 1e-18;
  return noise;
}

/// What a joint's gap may hold without any effect, per standard deviation.
Eigen::MatrixXd nuisance(const GapRows& rows, int joint, double kappa) {
  if (!(kappa > 0.0)) return rows.timing.col(joint);
  const Eigen::MatrixXd& model = rows.nuisance[static_cast<std::size_t>(joint)];
  Eigen::MatrixXd all(model.rows(), model.cols() + 1);
  all << kappa * model, rows.timing.col(joint);
  return all;
}

struct Normal {
  Eigen::MatrixXd G;     // p x p
  Eigen::VectorXd h;     // p
  Eigen::MatrixXd back;  // nuisance x (p + 1): A^-1 N^T [Phi | y]
  double log_det = 0.0;
};

Normal normal_equations(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                        const Eigen::MatrixXd& columns, const ChannelNoise& noise, double kappa) {
  const Eigen::Index p = columns.cols();
  Eigen::MatrixXd all(y.size(), p + 1);
  all << columns, y;
  const Eigen::MatrixXd w = whitened(rows, all, noise);
  Normal out;
  Eigen::MatrixXd G = w.transpose() * w;
  const Eigen::MatrixXd N = whitened(rows, nuisance(rows, joint, kappa), noise);
  Eigen::MatrixXd A = N.transpose() * N;
  A.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::MatrixXd> llt(A);
  const Eigen::MatrixXd NtW = N.transpose() * w;
  out.back = llt.solve(NtW);
  G -= NtW.transpose() * out.back;
  out.log_det = 2.0 * llt.matrixLLT().diagonal().array().log().sum();
  out.G = G.topLeftCorner(p, p);
  out.h = G.topRightCorner(p, 1);
  return out;
}

Eigen::VectorXd solve(Eigen::MatrixXd G, const Eigen::VectorXd& h, Eigen::MatrixXd* covariance) {
  if (h.size() == 0) return h;
  const Eigen::VectorXd scale = (G.diagonal().array() + 1e-300).sqrt().inverse();
  G = scale.asDiagonal() * G * scale.asDiagonal();
  G.diagonal().array() += 1e-10;
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(G);
  if (covariance != nullptr)
    *covariance =
        scale.asDiagonal() * ldlt.solve(Eigen::MatrixXd::Identity(G.rows(), G.cols())) * scale.asDiagonal();
  return scale.asDiagonal() * ldlt.solve(scale.asDiagonal() * h);
}

/// What theta leaves, what the nuisance takes of it, and the noise and evidence of the rest.
void finish(const GapRows& rows, int joint, const Normal& normal, const Eigen::VectorXd& left,
            const Eigen::VectorXd& theta, double kappa, ChannelNoise& noise, Eigen::VectorXd& residual,
            double& evidence) {
  residual = left;
  Eigen::VectorXd x(theta.size() + 1);
  x << -theta, 1.0;
  const Eigen::VectorXd delta = normal.back * x;
  residual -= nuisance(rows, joint, kappa) * delta;
  const double prior = delta.squaredNorm();
  noise = estimate(rows, residual);
  const double size = residual.squaredNorm() / double(rows.size()), floor = room * rows.white_floor[joint];
  evidence = -0.5 * (double(rows.size()) * ((1.0 - own_size) * std::log(noise.variance) +
                                            own_size * std::log(size + floor * floor + 1e-18)) +
                     prior + normal.log_det);
}

ChannelNoise first_guess(const Eigen::VectorXd& y) {
  return {Eigen::VectorXd::Zero(order), y.squaredNorm() / double(y.size()) + 1e-18};
}

}  // namespace

Eigen::MatrixXd whitened(const GapRows& rows, const Eigen::MatrixXd& x, const ChannelNoise& noise) {
  const Eigen::Index lags = noise.ar.size();
  Eigen::Index size = 0;
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p)
    size += std::max<Eigen::Index>(0, rows.parts[p + 1] - rows.parts[p] - lags);
  Eigen::MatrixXd w(size, x.cols());
  Eigen::Index at = 0;
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
    const Eigen::Index first = rows.parts[p] + lags, count = rows.parts[p + 1] - first;
    if (count <= 0) continue;
    auto part = w.middleRows(at, count);
    part = x.middleRows(first, count);
    for (Eigen::Index k = 0; k < lags; ++k) part -= noise.ar[k] * x.middleRows(first - k - 1, count);
    at += count;
  }
  w /= std::sqrt(noise.variance);
  return w;
}

ChannelFit fit_channel(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                       const Eigen::MatrixXd& columns, double kappa) {
  // The steps need not climb (a residual that wanders makes the next step look at its corners alone): the
  // best counts.
  ChannelFit best, fit;
  fit.noise = first_guess(y);
  for (int k = 0; k < iterations; ++k) {
    const Normal normal = normal_equations(rows, joint, y, columns, fit.noise, kappa);
    fit.theta = solve(normal.G, normal.h, nullptr);
    const Eigen::VectorXd left = fit.theta.size() > 0 ? Eigen::VectorXd(y - columns * fit.theta) : y;
    finish(rows, joint, normal, left, fit.theta, kappa, fit.noise, fit.residual, fit.evidence);
    if (k == 0 || fit.evidence > best.evidence) best = fit;
  }
  return best;
}

Fit fit_terms(const GapRows& rows, const Eigen::MatrixXd& y_all, const std::vector<Term>& terms,
              double kappa) {
  const int n = rows.joints();
  Eigen::MatrixXd y = y_all;
  std::vector<const RowBlock*> free;
  Eigen::Index size = 0;
  for (const Term& term : terms) {
    if (term.fixed) {
      for (std::size_t k = 0; k < term.block->channels.size(); ++k)
        y.col(term.block->channels[k]) -= term.block->values[k].rowwise().sum();
    } else {
      free.push_back(term.block);
      size += term.block->size();
    }
  }
  // Each joint's columns, and where they stand among all.
  std::vector<Eigen::MatrixXd> columns(static_cast<std::size_t>(n));
  std::vector<std::vector<Eigen::Index>> where(static_cast<std::size_t>(n));
  for (int j = 0; j < n; ++j) {
    const auto at = static_cast<std::size_t>(j);
    Eigen::Index offset = 0;
    std::vector<const Eigen::MatrixXd*> mine;
    for (const RowBlock* block : free) {
      if (const Eigen::MatrixXd* values = block->find(j)) {
        mine.push_back(values);
        for (Eigen::Index k = 0; k < values->cols(); ++k) where[at].push_back(offset + k);
      }
      offset += block->size();
    }
    columns[at].resize(rows.size(), static_cast<Eigen::Index>(where[at].size()));
    Eigen::Index column = 0;
    for (const Eigen::MatrixXd* values : mine) {
      columns[at].middleCols(column, values->cols()) = *values;
      column += values->cols();
    }
  }
  Fit best, fit;
  fit.left.resize(rows.size(), n);
  fit.residual.resize(rows.size(), n);
  fit.noise.resize(static_cast<std::size_t>(n));
  fit.evidence.resize(n);
  for (int j = 0; j < n; ++j) fit.noise[static_cast<std::size_t>(j)] = first_guess(y.col(j));
  for (int iteration = 0; iteration < iterations; ++iteration) {
    std::vector<Normal> normals;
    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd h = Eigen::VectorXd::Zero(size);
    for (int j = 0; j < n; ++j) {
      const auto at = static_cast<std::size_t>(j);
      normals.push_back(normal_equations(rows, j, y.col(j), columns[at], fit.noise[at], kappa));
      for (std::size_t a = 0; a < where[at].size(); ++a) {
        h[where[at][a]] += normals.back().h[static_cast<Eigen::Index>(a)];
        for (std::size_t b = 0; b < where[at].size(); ++b)
          G(where[at][a], where[at][b]) +=
              normals.back().G(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      }
    }
    fit.theta = solve(G, h, &fit.covariance);
    for (int j = 0; j < n; ++j) {
      const auto at = static_cast<std::size_t>(j);
      const Eigen::VectorXd mine = fit.theta(where[at]);
      Eigen::VectorXd left = y.col(j), residual;
      if (mine.size() > 0) left -= columns[at] * mine;
      finish(rows, j, normals[at], left, mine, kappa, fit.noise[at], residual, fit.evidence[j]);
      fit.left.col(j) = left;
      fit.residual.col(j) = residual;
    }
    fit.total = fit.evidence.sum();
    if (iteration == 0 || fit.total > best.total) best = fit;
  }
  return best;
}

}  // namespace dynid::detail
