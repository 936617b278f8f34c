// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace dynid {

/// Low-pass Butterworth filter of order 4 run forwards and backwards: zero phase, gain |H(f)|^2, so 1/2 at the cut-off.
class ZeroPhaseButterworth {
 public:
  /// `cutoff` [Hz], `rate` [Hz] of the uniform samples. Throws Error unless 0 < cutoff < rate / 2.
  ZeroPhaseButterworth(double cutoff, double rate);

  /// Filters each column of `x` (samples x channels) in place. The ends are extended by odd reflection and the filter
  /// starts in its steady state, so a constant or a slow line passes unchanged. Allocates one padded channel.
  void apply(Eigen::Ref<Eigen::MatrixXd> x) const;

  /// The symmetric impulse response h_0..h_K (h_-k = h_k), cut where what is left out is below 1e-6, and scaled to a
  /// unit sum: the same filter as a finite sum, for signals too wide to be kept.
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

/// Central differences of each column (one-sided of order 2 at the ends); `rate` [Hz]. Throws Error below 3 samples.
Eigen::MatrixXd differentiate(const Eigen::MatrixXd& x, double rate);

/// Values of `x(t)` (t increasing strictly, N >= 2) on `grid` (increasing) by cubic Hermite interpolation with
/// three-point slopes; beyond the ends the end values hold.
Eigen::VectorXd interpolate(const Eigen::Ref<const Eigen::VectorXd>& t, const Eigen::Ref<const Eigen::VectorXd>& x,
                            const Eigen::Ref<const Eigen::VectorXd>& grid);

}  // namespace dynid
