// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace dynid {

/// Low-pass Butterworth filter of order 4 run forwards and backwards: zero phase, gain |H(f)|^2, so 1/2 at
/// the cut-off.
class ZeroPhaseButterworth {
 public:
  /// `cutoff` [Hz], `rate` [Hz] of the uniform samples. Throws Error unless 0 < cutoff < rate / 2.
  ZeroPhaseButterworth(double cutoff, double rate);

  /// Filters each column of `x` (samples x channels) in place. The ends are extended by odd reflection and
  /// the filter starts in its steady state, so a constant or a slow line passes unchanged. Allocates one
  /// padded channel.
  void apply(Eigen::Ref<Eigen::MatrixXd> x) const;

  /// The symmetric impulse response h_0..h_K (h_-k = h_k), cut where what is left out is below 1e-5, and
  /// scaled to a unit sum: the same filter as a finite sum, for signals too wide to be kept.
  Eigen::VectorXd half_kernel() const;

 private:
  struct Section {
    double b0, b1, b2, a1, a2;
  };
  void run(double* x, Eigen::Index size) const noexcept;

  Section sections_[2];
  double cutoff_;
  double rate_;
};

/// The same low-pass filter followed by decimation, as a finite sum over the kernel. What it does at the ends
/// of a signal (the kernel is cut there and scaled to a unit sum) is still one linear map, so that torque and
/// regressor columns that pass through it keep their relation exactly.
class DecimatingFilter {
 public:
  /// One output every `factor` samples. `half_kernel` as from ZeroPhaseButterworth.
  DecimatingFilter(Eigen::VectorXd half_kernel, Eigen::Index factor);

  /// Outputs for N input samples.
  Eigen::Index outputs(Eigen::Index samples) const noexcept;
  /// Input sample that output k stands on.
  Eigen::Index centre(Eigen::Index k) const noexcept { return factor_ / 2 + k * factor_; }
  /// K: output k depends on the samples centre(k) - K .. centre(k) + K.
  Eigen::Index reach() const noexcept { return half_kernel_.size() - 1; }
  /// Variance that it leaves of white noise of variance 1, away from the ends.
  double white_gain() const noexcept {
    return half_kernel_[0] * half_kernel_[0] + 2.0 * half_kernel_.tail(reach()).squaredNorm();
  }
  /// Output k of each column of `x`, which holds the samples `first` .. `first + x.rows() - 1` of a signal of
  /// `samples` and must cover what output k depends on.
  Eigen::RowVectorXd output(Eigen::Index k, const Eigen::Ref<const Eigen::MatrixXd>& x, Eigen::Index first,
                            Eigen::Index samples) const;
  /// All outputs of the whole signal `x` (samples x channels).
  Eigen::MatrixXd apply(const Eigen::Ref<const Eigen::MatrixXd>& x) const;

 private:
  Eigen::VectorXd half_kernel_, kernel_;  // kernel_: both halves, of sum 1
  Eigen::Index factor_;
};

/// Central differences of each column (one-sided of order 2 at the ends); `rate` [Hz]. Throws Error below 3
/// samples.
Eigen::MatrixXd differentiate(const Eigen::MatrixXd& x, double rate);

/// Values of `x(t)` (t increasing strictly, N >= 2) on `grid` (increasing) by cubic Hermite interpolation
/// with three-point slopes; beyond the ends the end values hold.
Eigen::VectorXd interpolate(const Eigen::Ref<const Eigen::VectorXd>& t,
                            const Eigen::Ref<const Eigen::VectorXd>& x,
                            const Eigen::Ref<const Eigen::VectorXd>& grid);

}  // namespace dynid
