// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace dynid {

/// One-sided power spectral density.
struct Spectrum {
  Eigen::VectorXd frequency;  ///< [Hz] 0 .. rate / 2
  Eigen::VectorXd density;    ///< [unit^2 / Hz]
};

/// Welch's estimate for uniform samples `x` at `rate` [Hz]: Hann windows of about `window` [s], half
/// overlapping, each without its mean. Throws Error below 8 samples.
Spectrum welch(const Eigen::Ref<const Eigen::VectorXd>& x, double rate, double window);

}  // namespace dynid
