// SPDX-License-Identifier: Apache-2.0
#include "dynid/signal/filter.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

#include "dynid/base/error.hpp"

namespace dynid {

ZeroPhaseButterworth::ZeroPhaseButterworth(double cutoff, double rate) : cutoff_(cutoff), rate_(rate) {
  if (!(cutoff > 0.0) || !(cutoff < 0.5 * rate)) {
    std::ostringstream text;
    text << "cut-off frequency " << cutoff << " Hz: it must lie between 0 and half the sampling rate, "
         << 0.5 * rate << " Hz";
    throw Error(text.str());
  }
  // Bilinear transform with the cut-off prewarped; one section a pair of conjugate poles.
  const double w = std::tan(M_PI * cutoff / rate);
  for (int k = 0; k < 2; ++k) {
    const double damping = 2.0 * std::cos(M_PI * (2 * k + 1) / 8.0);
    const double a0 = 1.0 + damping * w + w * w;
    sections_[k] = {w * w / a0, 2.0 * w * w / a0, w * w / a0, 2.0 * (w * w - 1.0) / a0,
                    (1.0 - damping * w + w * w) / a0};
  }
}

void ZeroPhaseButterworth::run(double* x, Eigen::Index size) const noexcept {
  for (const Section& s : sections_) {
    // Steady state of the transposed direct form for a constant input equal to the first sample (unit static
    // gain).
    double z1 = (1.0 - s.b0) * x[0];
    double z2 = (s.b2 - s.a2) * x[0];
    for (Eigen::Index i = 0; i < size; ++i) {
      const double in = x[i];
      const double out = s.b0 * in + z1;
      z1 = s.b1 * in - s.a1 * out + z2;
      z2 = s.b2 * in - s.a2 * out;
      x[i] = out;
    }
  }
}

void ZeroPhaseButterworth::apply(Eigen::Ref<Eigen::MatrixXd> x) const {
  const Eigen::Index n = x.rows();
  if (n == 0) return;
  // Two periods of the cut-off: by then the slowest pole has decayed by exp(-2 pi 0.38 2) < 1 %, of an odd
  // extension.
  const Eigen::Index pad = std::min(n - 1, static_cast<Eigen::Index>(std::ceil(2.0 * rate_ / cutoff_)));
  Eigen::VectorXd work(n + 2 * pad);
  for (Eigen::Index c = 0; c < x.cols(); ++c) {
    work.segment(pad, n) = x.col(c);
    for (Eigen::Index i = 1; i <= pad; ++i) {
      work[pad - i] = 2.0 * x(0, c) - x(i, c);
      work[pad + n - 1 + i] = 2.0 * x(n - 1, c) - x(n - 1 - i, c);
    }
    run(work.data(), work.size());
    work.reverseInPlace();
    run(work.data(), work.size());
    work.reverseInPlace();
    x.col(c) = work.segment(pad, n);
  }
}

Eigen::VectorXd ZeroPhaseButterworth::half_kernel() const {
  const auto reach = static_cast<Eigen::Index>(std::ceil(8.0 * rate_ / cutoff_));
  Eigen::VectorXd impulse = Eigen::VectorXd::Zero(4 * reach + 1);
  impulse[2 * reach] = 1.0;
  run(impulse.data(), impulse.size());
  impulse.reverseInPlace();
  run(impulse.data(), impulse.size());
  Eigen::VectorXd half = impulse.segment(2 * reach, reach + 1);
  Eigen::Index last = reach;
  double left_out = 0.0;
  while (last > 1 && left_out + 2.0 * std::abs(half[last]) < 1e-5) left_out += 2.0 * std::abs(half[last--]);
  half.conservativeResize(last + 1);
  return half / (2.0 * half.sum() - half[0]);
}

DecimatingFilter::DecimatingFilter(Eigen::VectorXd half_kernel, Eigen::Index factor)
    : half_kernel_(std::move(half_kernel)), factor_(factor) {
  const Eigen::Index K = reach();
  kernel_.resize(2 * K + 1);
  kernel_ << half_kernel_.tail(K).reverse(), half_kernel_;
  kernel_ /= kernel_.sum();
}

Eigen::Index DecimatingFilter::outputs(Eigen::Index samples) const noexcept {
  return samples <= factor_ / 2 ? 0 : (samples - 1 - factor_ / 2) / factor_ + 1;
}

Eigen::RowVectorXd DecimatingFilter::output(Eigen::Index k, const Eigen::Ref<const Eigen::MatrixXd>& x,
                                            Eigen::Index first, Eigen::Index samples) const {
  const Eigen::Index c = centre(k), K = reach();
  const Eigen::Index from = std::max<Eigen::Index>(0, c - K), to = std::min(samples - 1, c + K);
  if (to - from == 2 * K) {  // away from the ends
    Eigen::RowVectorXd out(x.cols());
    for (Eigen::Index j = 0; j < x.cols(); ++j)
      out[j] = kernel_.dot(x.col(j).segment(from - first, 2 * K + 1));
    return out;
  }
  Eigen::VectorXd weights(to - from + 1);
  for (Eigen::Index i = from; i <= to; ++i) weights[i - from] = half_kernel_[std::abs(i - c)];
  return (weights.transpose() / weights.sum()) * x.middleRows(from - first, to - from + 1);
}

Eigen::MatrixXd DecimatingFilter::apply(const Eigen::Ref<const Eigen::MatrixXd>& x) const {
  Eigen::MatrixXd out(outputs(x.rows()), x.cols());
  for (Eigen::Index k = 0; k < out.rows(); ++k) out.row(k) = output(k, x, 0, x.rows());
  return out;
}

Eigen::MatrixXd differentiate(const Eigen::MatrixXd& x, double rate) {
  const Eigen::Index n = x.rows();
  if (n < 3) throw Error("differentiation needs at least 3 samples, found " + std::to_string(n));
  Eigen::MatrixXd d(n, x.cols());
  d.middleRows(1, n - 2) = 0.5 * rate * (x.bottomRows(n - 2) - x.topRows(n - 2));
  d.row(0) = 0.5 * rate * (-3.0 * x.row(0) + 4.0 * x.row(1) - x.row(2));
  d.row(n - 1) = 0.5 * rate * (3.0 * x.row(n - 1) - 4.0 * x.row(n - 2) + x.row(n - 3));
  return d;
}

Eigen::VectorXd interpolate(const Eigen::Ref<const Eigen::VectorXd>& t,
                            const Eigen::Ref<const Eigen::VectorXd>& x,
                            const Eigen::Ref<const Eigen::VectorXd>& grid) {
  const Eigen::Index n = t.size();
  const auto slope = [&](Eigen::Index i) {
    if (i == 0) return (x[1] - x[0]) / (t[1] - t[0]);
    if (i == n - 1) return (x[n - 1] - x[n - 2]) / (t[n - 1] - t[n - 2]);
    const double h0 = t[i] - t[i - 1], h1 = t[i + 1] - t[i];
    return ((x[i] - x[i - 1]) / h0 * h1 + (x[i + 1] - x[i]) / h1 * h0) / (h0 + h1);
  };
  Eigen::VectorXd out(grid.size());
  Eigen::Index i = 0;
  for (Eigen::Index k = 0; k < grid.size(); ++k) {
    if (grid[k] <= t[0]) {
      out[k] = x[0];
      continue;
    }
    if (grid[k] >= t[n - 1]) {
      out[k] = x[n - 1];
      continue;
    }
    while (t[i + 1] < grid[k]) ++i;
    const double h = t[i + 1] - t[i], s = (grid[k] - t[i]) / h;
    const double d0 = slope(i) * h, d1 = slope(i + 1) * h, rise = x[i + 1] - x[i];
    out[k] = x[i] + s * (d0 + s * (3.0 * rise - 2.0 * d0 - d1 + s * (d0 + d1 - 2.0 * rise)));
  }
  return out;
}

}  // namespace dynid
