// SPDX-License-Identifier: Apache-2.0
#include "fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace dynid::detail {
namespace {

constexpr int order = 4;       // of the autoregression
constexpr int iterations = 3;  // of noise and coefficients
// An autoregression can take any smooth gap for noise of its own colour. What speaks against it is its size:
// half the evidence is the likelihood of innovations, half that of the residual itself, with room for
// coloured noise of this many times the white floor.
constexpr double own_size = 0.5, room = 3.0;
// Stamps later than this many times the usual are no longer a matter of the data: they are a gap.
constexpr double latest = 2.0;

/// Yule-Walker: biased autocovariances over the parts, hence always stable.
ChannelNoise estimate(const GapRows& rows, int joint, const Eigen::VectorXd& e) {
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
  noise.variance = w.squaredNorm() / double(w.rows()) * (double(rows.size()) / rows.active[joint]) + 1e-18;
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
};

Normal normal_equations(const GapRows& rows, const Eigen::VectorXd& y, const Eigen::MatrixXd& columns,
                        const Whitener& by) {
  const Eigen::Index p = columns.cols();
  Eigen::MatrixXd all(y.size(), p + 1);
  all << columns, y;
  const Eigen::MatrixXd w = whitened(rows, all, by.noise);
  Normal out;
  Eigen::MatrixXd G = w.transpose() * w;
  const Eigen::MatrixXd NtW = by.nuisance.transpose() * w;
  out.back = by.llt.solve(NtW);
  G -= NtW.transpose() * out.back;
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
void finish(const GapRows& rows, int joint, const Normal& normal, double log_det, const Eigen::VectorXd& left,
            const Eigen::VectorXd& theta, double kappa, ChannelNoise& noise, Eigen::VectorXd& residual,
            double& evidence) {
  Eigen::VectorXd x(theta.size() + 1);
  x << -theta, 1.0;
  const Eigen::VectorXd delta = normal.back * x;
  residual = left - std::clamp(delta[delta.size() - 1], -latest, latest) * rows.timing.col(joint);
  if (kappa > 0.0)
    residual.noalias() -=
        rows.nuisance[static_cast<std::size_t>(joint)] * (kappa * delta.head(delta.size() - 1));
  const double prior = delta.squaredNorm();
  noise = estimate(rows, joint, residual);
  const double size = residual.squaredNorm() / rows.active[joint], floor = room * rows.white_floor[joint];
  evidence = -0.5 * (rows.active[joint] * ((1.0 - own_size) * std::log(noise.variance) +
                                           own_size * std::log(size + floor * floor + 1e-18)) +
                     prior + log_det);
}

/// One step: coefficients by the given noise, then the noise of what they leave.
void step(const GapRows& rows, int joint, const Eigen::VectorXd& y, const Eigen::MatrixXd& columns,
          double kappa, const Whitener& by, ChannelFit& fit) {
  const Normal normal = normal_equations(rows, y, columns, by);
  fit.theta = solve(normal.G, normal.h, nullptr);
  const Eigen::VectorXd left = fit.theta.size() > 0 ? Eigen::VectorXd(y - columns * fit.theta) : y;
  finish(rows, joint, normal, by.log_det, left, fit.theta, kappa, fit.noise, fit.residual, fit.evidence);
}

/// Terms put together: each joint's gap less what is fixed, its columns, and where they stand among all.
struct Assembled {
  Eigen::MatrixXd y;
  std::vector<Eigen::MatrixXd> columns;
  std::vector<std::vector<Eigen::Index>> where;
  std::vector<Term> free;
  Eigen::Index size = 0;
};

Assembled assemble(const GapRows& rows, const Eigen::MatrixXd& y, const std::vector<Term>& terms) {
  const auto n = static_cast<std::size_t>(rows.joints());
  Assembled out{y, std::vector<Eigen::MatrixXd>(n), std::vector<std::vector<Eigen::Index>>(n), {}, 0};
  for (const Term& term : terms) {
    if (term.fixed()) {
      for (std::size_t k = 0; k < term.block->channels.size(); ++k)
        out.y.col(term.block->channels[k]) -= term.block->values[k].rowwise().sum();
    } else {
      out.free.push_back(term);
      out.size += term.block->size();
    }
  }
  for (std::size_t j = 0; j < n; ++j) {
    Eigen::Index offset = 0;
    std::vector<const Eigen::MatrixXd*> mine;
    for (const Term& term : out.free) {
      if (const Eigen::MatrixXd* values = term.block->find(static_cast<int>(j))) {
        mine.push_back(values);
        for (Eigen::Index k = 0; k < values->cols(); ++k) out.where[j].push_back(offset + k);
      }
      offset += term.block->size();
    }
    out.columns[j].resize(rows.size(), static_cast<Eigen::Index>(out.where[j].size()));
    Eigen::Index column = 0;
    for (const Eigen::MatrixXd* values : mine) {
      out.columns[j].middleCols(column, values->cols()) = *values;
      column += values->cols();
    }
  }
  return out;
}

/// Coefficients that no such effect can have give way to the nearest that it can, the others following.
void keep_possible(const Assembled& all, const Eigen::MatrixXd& G, const Eigen::VectorXd& h,
                   Eigen::VectorXd& theta) {
  Eigen::Index at = 0;
  for (const Term& term : all.free) {
    const Eigen::Index p = term.block->size(), rest = all.size - p;
    const Eigen::VectorXd mine = theta.segment(at, p);
    std::vector<Eigen::Index> others, own;
    for (Eigen::Index k = 0; k < all.size; ++k) (k < at || k >= at + p ? others : own).push_back(k);
    at += p;
    const Eigen::VectorXd& nominal = term.block->nominal;
    if (term.of == nullptr || nominal.size() == 0) continue;
    const Eigen::VectorXd whole = mine + nominal;
    if (term.of->possible(whole)) continue;
    Eigen::MatrixXd information = G(own, own);
    if (rest > 0) {
      Eigen::MatrixXd A = G(others, others);
      A.diagonal() *= 1.0 + 1e-10;
      information -= G(own, others) * A.ldlt().solve(G(others, own));
    }
    const Eigen::VectorXd nearest = term.of->nearest_possible(whole, information) - nominal;
    theta(own) = nearest;
    if (rest > 0) theta(others) = solve(G(others, others), h(others) - G(others, own) * nearest, nullptr);
  }
}

/// One step of all joints together.
void step(const GapRows& rows, const Assembled& all, double kappa, const std::vector<Whitener>& by,
          Fit& fit) {
  const auto n = static_cast<std::size_t>(rows.joints());
  std::vector<Normal> normals;
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(all.size, all.size);
  Eigen::VectorXd h = Eigen::VectorXd::Zero(all.size);
  for (std::size_t j = 0; j < n; ++j) {
    normals.push_back(normal_equations(rows, all.y.col(static_cast<Eigen::Index>(j)), all.columns[j], by[j]));
    const std::vector<Eigen::Index>& where = all.where[j];
    h(where) += normals.back().h;
    G(where, where) += normals.back().G;
  }
  fit.theta = solve(G, h, nullptr);
  keep_possible(all, G, h, fit.theta);
  fit.left.resize(rows.size(), rows.joints());
  fit.residual.resize(rows.size(), rows.joints());
  fit.noise.resize(n);
  fit.evidence.resize(rows.joints());
  for (std::size_t k = 0; k < n; ++k) {
    const auto j = static_cast<Eigen::Index>(k);
    const Eigen::VectorXd mine = fit.theta(all.where[k]);
    Eigen::VectorXd left = all.y.col(j), residual;
    if (mine.size() > 0) left -= all.columns[k] * mine;
    finish(rows, static_cast<int>(k), normals[k], by[k].log_det, left, mine, kappa, fit.noise[k], residual,
           fit.evidence[j]);
    fit.left.col(j) = left;
    fit.residual.col(j) = residual;
  }
  fit.total = fit.evidence.sum();
}

}  // namespace

Eigen::MatrixXd covariance_of(const GapRows& rows, const std::vector<Term>& terms,
                              const std::vector<ChannelNoise>& noise, double kappa) {
  const Assembled all = assemble(rows, rows.y, terms);
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(all.size, all.size), covariance;
  for (int j = 0; j < rows.joints(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    const Whitener by = whitener(rows, j, noise[at], kappa);
    G(all.where[at], all.where[at]) += normal_equations(rows, all.y.col(j), all.columns[at], by).G;
  }
  solve(G, Eigen::VectorXd::Zero(all.size), &covariance);
  return covariance;
}

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
    const auto past = [&](Eigen::Index k) { return x.middleRows(first - k, count); };
    if (noise.ar.isZero(0.0)) {
      part = past(0);
    } else if (lags == 4) {  // the usual order, in one pass
      part = past(0) - noise.ar[0] * past(1) - noise.ar[1] * past(2) - noise.ar[2] * past(3) -
             noise.ar[3] * past(4);
    } else {
      part = past(0);
      for (Eigen::Index k = 0; k < lags; ++k) part -= noise.ar[k] * past(k + 1);
    }
    at += count;
  }
  w /= std::sqrt(noise.variance);
  return w;
}

Whitener whitener(const GapRows& rows, int joint, const ChannelNoise& noise, double kappa) {
  Whitener out;
  out.noise = noise;
  out.nuisance = whitened(rows, nuisance(rows, joint, kappa), noise);
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(out.nuisance.cols(), out.nuisance.cols());
  A.selfadjointView<Eigen::Lower>().rankUpdate(out.nuisance.transpose());
  out.llt.compute(A);
  out.log_det = 2.0 * out.llt.matrixLLT().diagonal().array().log().sum();
  return out;
}

double evidence_with_form(const GapRows& rows, const Fit& fit, const Eigen::VectorXd& size,
                          const Eigen::VectorXd& innovation) {
  double total = fit.total;
  for (Eigen::Index j = 0; j < fit.residual.cols(); ++j) {
    const double variance = fit.noise[static_cast<std::size_t>(j)].variance,
                 floor = room * rows.white_floor[j],
                 left = fit.residual.col(j).squaredNorm() / rows.active[j] + floor * floor + 1e-18;
    total -=
        0.5 * rows.active[j] *
        ((1.0 - own_size) * std::log1p(innovation[j] / variance) + own_size * std::log1p(size[j] / left));
  }
  return total;
}

ChannelNoise white(const Eigen::VectorXd& y) {
  return {Eigen::VectorXd::Zero(order), y.squaredNorm() / double(y.size()) + 1e-18};
}

ChannelFit fit_channel(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                       const Eigen::MatrixXd& columns, double kappa) {
  // The steps need not climb (a residual that wanders makes the next step look at its corners alone): the
  // best counts.
  ChannelFit best, fit;
  fit.noise = white(y);
  for (int k = 0; k < iterations; ++k) {
    step(rows, joint, y, columns, kappa, whitener(rows, joint, fit.noise, kappa), fit);
    if (k == 0 || fit.evidence > best.evidence) best = fit;
  }
  return best;
}

ChannelFit fit_channel(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                       const Eigen::MatrixXd& columns, double kappa, const std::vector<Whitener>& by) {
  ChannelFit best, fit;
  for (std::size_t k = 0; k < by.size(); ++k) {
    step(rows, joint, y, columns, kappa, by[k], fit);
    if (k == 0 || fit.evidence > best.evidence) best = fit;
  }
  return best;
}

Fit fit_terms(const GapRows& rows, const Eigen::MatrixXd& y, const std::vector<Term>& terms, double kappa) {
  const Assembled all = assemble(rows, y, terms);
  Fit best, fit;
  for (Eigen::Index j = 0; j < y.cols(); ++j) fit.noise.push_back(white(all.y.col(j)));
  for (int k = 0; k < iterations; ++k) {
    std::vector<Whitener> by;
    for (int j = 0; j < rows.joints(); ++j)
      by.push_back(whitener(rows, j, fit.noise[static_cast<std::size_t>(j)], kappa));
    step(rows, all, kappa, by, fit);
    if (k == 0 || fit.total > best.total) best = fit;
  }
  return best;
}

Fit fit_terms(const GapRows& rows, const Eigen::MatrixXd& y, const std::vector<Term>& terms, double kappa,
              const std::vector<std::vector<Whitener>>& by) {
  const Assembled all = assemble(rows, y, terms);
  Fit best, fit;
  for (std::size_t k = 0; k < by.size(); ++k) {
    step(rows, all, kappa, by[k], fit);
    if (k == 0 || fit.total > best.total) best = fit;
  }
  return best;
}

}  // namespace dynid::detail
