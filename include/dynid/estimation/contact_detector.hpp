// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>

#include "dynid/base/error.hpp"

namespace dynid {

/// A contact flag for each joint: set above a threshold, cleared below a lower one. The constructor throws;
/// nothing else does.
template <int N = Eigen::Dynamic>
class ContactDetector {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;
  using Flags = Eigen::Array<bool, N, 1>;

  /// threshold [N m]: |r| above which a joint is in contact; release [N m]: |r| below which it no longer is.
  /// n each. Throws Error unless 0 <= release <= threshold, threshold > 0.
  ContactDetector(const Vector& threshold, const Vector& release)
      : threshold_(threshold), release_(release), flags_(Flags::Constant(threshold.size(), false)) {
    if (release.size() != threshold.size()) throw Error("contact release: one value for each joint");
    for (Eigen::Index i = 0; i < threshold.size(); ++i)
      if (!(threshold[i] > 0.0) || !(release[i] >= 0.0 && release[i] <= threshold[i]))
        throw Error("contact threshold of joint " + std::to_string(i + 1) +
                    ": must be positive, its release between 0 and it");
  }

  /// r: external torque [N m], n, finite. Returns the flags.
  const Flags& update(const Vector& r) noexcept {
    for (Eigen::Index i = 0; i < flags_.size(); ++i)
      flags_[i] = std::abs(r[i]) > (flags_[i] ? release_[i] : threshold_[i]);
    return flags_;
  }
  /// Other thresholds, n each, 0 <= release <= threshold; the flags stay as they are until the next update().
  void set_thresholds(const Vector& threshold, const Vector& release) noexcept {
    threshold_ = threshold;
    release_ = release;
  }
  void reset() noexcept { flags_.setConstant(false); }

  const Vector& threshold() const noexcept { return threshold_; }  ///< [N m], n
  const Flags& flags() const noexcept { return flags_; }
  bool any() const noexcept { return flags_.any(); }

 private:
  Vector threshold_, release_;
  Flags flags_;
};

}  // namespace dynid
