// SPDX-License-Identifier: Apache-2.0
#include "fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dynid::detail {
namespace {

constexpr int iterations = 3;  // of noise and coefficients
// An autoregression can take any smooth gap for noise of its own colour. What speaks against it is its size:
// half the evidence is the likelihood of innovations, half that of the residual itself, with room for
// coloured noise of this many times the white floor.
constexpr double own_size = 0.5, room = 3.0;
// Of a column's energy: what is left of it beside others and is less says nothing.
constexpr double within_rounding = 1e-9;
// Stamps later than this many times the usual are no longer a matter of the data: they are a gap.
constexpr double latest = 2.0;

/// Yule-Walker: biased autocovariances over the parts, hence always stable.
ChannelNoise estimate(const GapRows& rows, int joint, const Eigen::VectorXd& e) {
  Eigen::VectorXd r = Eigen::VectorXd::Zero(noise_order + 1);
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
    const Eigen::Index size = rows.parts[p + 1] - rows.parts[p];
    const auto x = e.segment(rows.parts[p], size);
    for (int k = 0; k <= noise_order && k < size; ++k) r[k] += x.head(size - k).dot(x.tail(size - k));
  }
  ChannelNoise noise;
  Eigen::MatrixXd R(noise_order, noise_order);
  for (int i = 0; i < noise_order; ++i)
    for (int k = 0; k < noise_order; ++k) R(i, k) = r[std::abs(i - k)];
  R.diagonal().array() += 1e-9 * r[0] + 1e-30;
  noise.ar = R.ldlt().solve(r.tail(noise_order));
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
  double yy = 0.0;       // of what normal_equations() makes: y^T y
};

Normal normal_equations(const SeenChannel& base) {
  const Eigen::Index p = base.gram.cols() - 1;
  return {base.gram.topLeftCorner(p, p), base.gram.topRightCorner(p, 1), base.taken, base.gram(p, p)};
}

/// Of the base's columns, then `more` (rows x e), for the base's gap less `fixed` (rows, or empty).
Normal normal_equations(const GapRows& rows, const SeenChannel& base, const Eigen::MatrixXd& more,
                        const Eigen::VectorXd& fixed) {
  const Eigen::Index p = base.gram.cols() - 1, e = more.cols(), f = fixed.size() > 0 ? 1 : 0;
  if (e + f == 0) return normal_equations(base);
  Eigen::MatrixXd added(rows.size(), e + f);
  added.leftCols(e) = more;
  if (f > 0) added.col(e) = fixed;
  const Eigen::MatrixXd w = whitened(rows, added, base.by.noise);
  const Eigen::MatrixXd NtW = base.by.nuisance.transpose() * w, taken = base.by.llt.solve(NtW);
  Eigen::MatrixXd cross = w.transpose() * base.white, own = w.transpose() * w;
  cross.noalias() -= NtW.transpose() * base.taken;
  own.noalias() -= NtW.transpose() * taken;
  Normal out;
  out.G.resize(p + e, p + e);
  out.G << base.gram.topLeftCorner(p, p), cross.topLeftCorner(e, p).transpose(), cross.topLeftCorner(e, p),
      own.topLeftCorner(e, e);
  out.h.resize(p + e);
  out.h << base.gram.topRightCorner(p, 1), cross.topRightCorner(e, 1);
  out.back.resize(taken.rows(), p + e + 1);
  out.back << base.taken.leftCols(p), taken.leftCols(e), base.taken.rightCols(1);
  out.yy = base.gram(p, p);
  if (f > 0) {
    out.yy += own(e, e) - 2.0 * cross(e, p);
    out.h.head(p) -= cross.bottomLeftCorner(1, p).transpose();
    out.h.tail(e) -= own.topRightCorner(e, 1);
    out.back.rightCols(1) -= taken.rightCols(1);
  }
  return out;
}

}  // namespace

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

namespace {

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
/// `free`: the terms that theta is of.
void keep_possible(const std::vector<Term>& free, const Eigen::MatrixXd& G, const Eigen::VectorXd& h,
                   Eigen::VectorXd& theta) {
  Eigen::Index at = 0;
  for (const Term& term : free) {
    const Eigen::Index p = term.block->size(), rest = theta.size() - p;
    const Eigen::VectorXd mine = theta.segment(at, p);
    std::vector<Eigen::Index> others, own;
    for (Eigen::Index k = 0; k < theta.size(); ++k) (k < at || k >= at + p ? others : own).push_back(k);
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

/// One step of all joints together: coefficients by the given noise, then the noise of what they leave. The
/// gap is `base`'s less what `more` fixes.
void step(const GapRows& rows, const Assembled& base, const Assembled& more, double kappa,
          const std::vector<SeenChannel>& by, Fit& fit) {
  const auto n = static_cast<std::size_t>(rows.joints());
  const Eigen::Index size = base.size + more.size;
  std::vector<Normal> normals;
  std::vector<std::vector<Eigen::Index>> where = base.where;
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd h = Eigen::VectorXd::Zero(size);
  for (std::size_t j = 0; j < n; ++j) {
    const auto fixed = more.y.col(static_cast<Eigen::Index>(j));
    normals.push_back(normal_equations(rows, by[j], more.columns[j],
                                       fixed.isZero(0.0) ? Eigen::VectorXd() : Eigen::VectorXd(-fixed)));
    for (const Eigen::Index k : more.where[j]) where[j].push_back(base.size + k);
    h(where[j]) += normals.back().h;
    G(where[j], where[j]) += normals.back().G;
  }
  fit.theta = solve(G, h, nullptr);
  std::vector<Term> free = base.free;
  free.insert(free.end(), more.free.begin(), more.free.end());
  keep_possible(free, G, h, fit.theta);
  fit.left = base.y + more.y;
  fit.residual.resize(rows.size(), rows.joints());
  fit.noise.resize(n);
  fit.evidence.resize(rows.joints());
  for (std::size_t k = 0; k < n; ++k) {
    const auto j = static_cast<Eigen::Index>(k);
    const Eigen::VectorXd mine = fit.theta(where[k]);
    const Eigen::Index p = base.columns[k].cols(), e = more.columns[k].cols();
    if (p > 0) fit.left.col(j).noalias() -= base.columns[k] * mine.head(p);
    if (e > 0) fit.left.col(j).noalias() -= more.columns[k] * mine.tail(e);
    Eigen::VectorXd residual;
    finish(rows, static_cast<int>(k), normals[k], by[k].by.log_det, fit.left.col(j), mine, kappa,
           fit.noise[k], residual, fit.evidence[j]);
    fit.residual.col(j) = residual;
  }
  fit.total = fit.evidence.sum();
}

/// What is added to a gap of zero.
Assembled added(const GapRows& rows, const std::vector<Term>& more) {
  return assemble(rows, Eigen::MatrixXd::Zero(rows.size(), rows.joints()), more);
}

}  // namespace

Eigen::MatrixXd information_of(const GapRows& rows, const std::vector<Term>& terms,
                               const std::vector<ChannelNoise>& noise, double kappa) {
  const Assembled all = assemble(rows, rows.y, terms);
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(all.size, all.size);
  for (int j = 0; j < rows.joints(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    G(all.where[at], all.where[at]) +=
        normal_equations(seen(rows, all.y.col(j), all.columns[at], whitener(rows, j, noise[at], kappa))).G;
  }
  return G;
}

Eigen::MatrixXd covariance_of(const GapRows& rows, const std::vector<Term>& terms,
                              const std::vector<ChannelNoise>& noise, double kappa) {
  const Eigen::MatrixXd G = information_of(rows, terms, noise, kappa);
  Eigen::MatrixXd covariance;
  solve(G, Eigen::VectorXd::Zero(G.rows()), &covariance);
  return covariance;
}

Eigen::VectorXd answer_to(const GapRows& rows, const std::vector<Term>& terms, const Eigen::MatrixXd& more,
                          const std::vector<ChannelNoise>& noise, double kappa) {
  std::vector<Term> free;
  std::copy_if(terms.begin(), terms.end(), std::back_inserter(free),
               [](const Term& t) { return !t.fixed(); });
  const Assembled all = assemble(rows, more, free);
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(all.size, all.size);
  Eigen::VectorXd h = Eigen::VectorXd::Zero(all.size);
  for (int j = 0; j < rows.joints(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    const Normal normal =
        normal_equations(seen(rows, all.y.col(j), all.columns[at], whitener(rows, j, noise[at], kappa)));
    G(all.where[at], all.where[at]) += normal.G;
    h(all.where[at]) += normal.h;
  }
  return solve(G, h, nullptr);
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

Eigen::MatrixXd whitened_back(const GapRows& rows, const Eigen::MatrixXd& w, const ChannelNoise& noise) {
  const Eigen::Index lags = noise.ar.size();
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(rows.size(), w.cols());
  Eigen::Index at = 0;
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
    const Eigen::Index first = rows.parts[p] + lags, count = rows.parts[p + 1] - first;
    if (count <= 0) continue;
    const auto part = w.middleRows(at, count);
    x.middleRows(first, count) += part;
    for (Eigen::Index k = 0; k < lags && !noise.ar.isZero(0.0); ++k)
      x.middleRows(first - k - 1, count) -= noise.ar[k] * part;
    at += count;
  }
  x /= std::sqrt(noise.variance);
  return x;
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
  return {Eigen::VectorXd::Zero(noise_order), y.squaredNorm() / double(y.size()) + 1e-18};
}

SeenChannel seen(const GapRows& rows, const Eigen::VectorXd& y, const Eigen::MatrixXd& columns, Whitener by) {
  SeenChannel out{std::move(by), {}, {}, {}};
  Eigen::MatrixXd all(rows.size(), columns.cols() + 1);
  all << columns, y;
  out.white = whitened(rows, all, out.by.noise);
  const Eigen::MatrixXd NtW = out.by.nuisance.transpose() * out.white;
  out.taken = out.by.llt.solve(NtW);
  out.gram.noalias() = out.white.transpose() * out.white;
  out.gram.noalias() -= NtW.transpose() * out.taken;
  return out;
}

SeenTerms seen(const GapRows& rows, const std::vector<Term>& terms,
               const std::vector<std::vector<Whitener>>& by) {
  SeenTerms out{assemble(rows, rows.y, terms), {}, {}};
  const Eigen::Index size = out.terms.size;
  for (const std::vector<Whitener>& noise : by) {
    out.by.emplace_back();
    out.gram.emplace_back(Eigen::MatrixXd::Zero(size, size + 1));
    for (std::size_t j = 0; j < noise.size(); ++j) {
      out.by.back().push_back(
          seen(rows, out.terms.y.col(static_cast<Eigen::Index>(j)), out.terms.columns[j], noise[j]));
      const std::vector<Eigen::Index>& where = out.terms.where[j];
      const Eigen::MatrixXd& gram = out.by.back().back().gram;
      const auto p = static_cast<Eigen::Index>(where.size());
      out.gram.back()(where, where) += gram.topLeftCorner(p, p);
      out.gram.back()(where, size) += gram.topRightCorner(p, 1);
    }
  }
  return out;
}

std::vector<Eigen::MatrixXd> normal_equations_beside(const GapRows& rows, const SeenTerms& base,
                                                     const RowBlock& more) {
  const Eigen::Index size = base.terms.size, p = more.size();
  std::vector<Eigen::MatrixXd> out;
  for (std::size_t k = 0; k < base.by.size(); ++k) {
    Eigen::MatrixXd own = Eigen::MatrixXd::Zero(p, p + 1), cross = Eigen::MatrixXd::Zero(size, p);
    for (std::size_t c = 0; c < more.channels.size(); ++c) {
      const auto j = static_cast<std::size_t>(more.channels[c]);
      const Normal normal = normal_equations(rows, base.by[k][j], more.values[c], {});
      const auto b = static_cast<Eigen::Index>(base.terms.where[j].size());
      own.leftCols(p) += normal.G.bottomRightCorner(p, p);
      own.col(p) += normal.h.tail(p);
      cross(base.terms.where[j], Eigen::all) += normal.G.topRightCorner(b, p);
    }
    const Eigen::VectorXd energy = own.diagonal();
    if (size > 0) {
      const Eigen::VectorXd scale = (base.gram[k].diagonal().array() + 1e-300).sqrt().inverse();
      Eigen::MatrixXd G = scale.asDiagonal() * base.gram[k].leftCols(size) * scale.asDiagonal();
      G.diagonal().array() += 1e-10;
      const Eigen::MatrixXd scaled = scale.asDiagonal() * cross, by_base = G.ldlt().solve(scaled);
      own.leftCols(p).noalias() -= scaled.transpose() * by_base;
      own.col(p).noalias() -= by_base.transpose() * (scale.asDiagonal() * base.gram[k].col(size));
    }
    own.diagonal() += within_rounding * energy;
    out.push_back(std::move(own));
  }
  return out;
}

ChannelFit fit_channel(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                       const Eigen::MatrixXd& columns, double kappa) {
  // The steps need not climb (a residual that wanders makes the next step look at its corners alone): the
  // best counts.
  ChannelFit best;
  ChannelNoise noise = white(y);
  for (int k = 0; k < iterations; ++k) {
    const ChannelFit fit = fit_channel(rows, joint, y, columns, {nullptr}, kappa,
                                       {seen(rows, y, columns, whitener(rows, joint, noise, kappa))});
    noise = fit.noise;
    if (k == 0 || fit.evidence > best.evidence) best = fit;
  }
  return best;
}

ChannelFit fit_channel(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                       const Eigen::MatrixXd& columns, const Term& more, double kappa,
                       const std::vector<SeenChannel>& base) {
  const Eigen::MatrixXd none(rows.size(), 0);
  const Eigen::MatrixXd* const values = more.block == nullptr ? nullptr : more.block->find(joint);
  const Eigen::MatrixXd& free = values == nullptr || more.fixed() ? none : *values;
  const Eigen::VectorXd fixed =
      values != nullptr && more.fixed() ? Eigen::VectorXd(values->rowwise().sum()) : Eigen::VectorXd();
  ChannelFit best, fit;
  for (std::size_t k = 0; k < base.size(); ++k) {
    const Normal normal = normal_equations(rows, base[k], free, fixed);
    fit.theta = solve(normal.G, normal.h, nullptr);
    Eigen::VectorXd left = y;
    if (fixed.size() > 0) left -= fixed;
    if (columns.cols() > 0) left.noalias() -= columns * fit.theta.head(columns.cols());
    if (free.cols() > 0) left.noalias() -= free * fit.theta.tail(free.cols());
    finish(rows, joint, normal, base[k].by.log_det, left, fit.theta, kappa, fit.noise, fit.residual,
           fit.evidence);
    if (k == 0 || fit.evidence > best.evidence) best = fit;
  }
  return best;
}

double quick_gain(const GapRows& rows, int joint, const Term& more, const std::vector<SeenChannel>& base) {
  const Eigen::MatrixXd none(rows.size(), 0), *const values = more.block->find(joint);
  if (values == nullptr) return 0.0;
  const Eigen::VectorXd fixed = more.fixed() ? Eigen::VectorXd(values->rowwise().sum()) : Eigen::VectorXd();
  const auto left = [](const Normal& normal) {
    return std::max(normal.yy - normal.h.dot(solve(normal.G, normal.h, nullptr)), 1e-12 * normal.yy) + 1e-300;
  };
  double best = -std::numeric_limits<double>::infinity();
  for (const SeenChannel& b : base)
    best =
        std::max(best, 0.5 * rows.active[joint] *
                           std::log(left(normal_equations(b)) /
                                    left(normal_equations(rows, b, more.fixed() ? none : *values, fixed))));
  return best;
}

ChannelFit fit_subset(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                      const Eigen::MatrixXd& columns, const std::vector<Eigen::Index>& free,
                      const std::vector<Eigen::Index>& fixed, double kappa,
                      const std::vector<SeenChannel>& base) {
  const auto p = static_cast<Eigen::Index>(free.size());
  Eigen::VectorXd gap = y;
  for (const Eigen::Index k : fixed) gap -= columns.col(k);
  ChannelFit best, fit;
  for (std::size_t k = 0; k < base.size(); ++k) {
    const SeenChannel& all = base[k];
    Normal normal;
    normal.G = all.gram(free, free);
    normal.h = all.gram(free, all.gram.cols() - 1);
    normal.back.resize(all.taken.rows(), p + 1);
    normal.back.leftCols(p) = all.taken(Eigen::all, free);
    normal.back.col(p) = all.taken.rightCols(1);
    for (const Eigen::Index f : fixed) {
      normal.h -= all.gram(free, f);
      normal.back.col(p) -= all.taken.col(f);
    }
    fit.theta = solve(normal.G, normal.h, nullptr);
    Eigen::VectorXd left = gap;
    for (Eigen::Index i = 0; i < p; ++i)
      left -= fit.theta[i] * columns.col(free[static_cast<std::size_t>(i)]);
    finish(rows, joint, normal, all.by.log_det, left, fit.theta, kappa, fit.noise, fit.residual,
           fit.evidence);
    if (k == 0 || fit.evidence > best.evidence) best = fit;
  }
  return best;
}

Fit fit_terms(const GapRows& rows, const Eigen::MatrixXd& y, const std::vector<Term>& terms, double kappa) {
  const Assembled all = assemble(rows, y, terms), none = added(rows, {});
  Fit best, fit;
  for (Eigen::Index j = 0; j < y.cols(); ++j) fit.noise.push_back(white(all.y.col(j)));
  for (int k = 0; k < iterations; ++k) {
    std::vector<SeenChannel> by;
    for (int j = 0; j < rows.joints(); ++j) {
      const auto at = static_cast<std::size_t>(j);
      by.push_back(seen(rows, all.y.col(j), all.columns[at], whitener(rows, j, fit.noise[at], kappa)));
    }
    step(rows, all, none, kappa, by, fit);
    if (k == 0 || fit.total > best.total) best = fit;
  }
  return best;
}

Fit fit_terms(const GapRows& rows, const SeenTerms& base, const std::vector<Term>& more, double kappa) {
  const Assembled others = added(rows, more);
  Fit best, fit;
  for (std::size_t k = 0; k < base.by.size(); ++k) {
    step(rows, base.terms, others, kappa, base.by[k], fit);
    if (k == 0 || fit.total > best.total) best = fit;
  }
  return best;
}

}  // namespace dynid::detail
