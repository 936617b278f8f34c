// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>
#include <mutex>
#include <string>

#include "dynid/app/context.hpp"

namespace dynid::detail {

/// Seconds since it was made.
class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

/// Makes what the steps of a job report, each with a fraction of its own, a fraction of the job that never
/// falls. The first step has `first` of the whole; where a fraction falls back a new step begins, which gets
/// half of what is left.
class JobProgress {
 public:
  explicit JobProgress(const Context& context, double first = 1.0) : context_(context), room_(first) {
    context_.check();
  }
  JobProgress(const JobProgress&) = delete;
  JobProgress& operator=(const JobProgress&) = delete;

  /// Throws Stopped where a stop was requested.
  void operator()(const std::string& stage, double fraction) {
    context_.check();
    tell(stage, fraction);
  }
  /// The same, but does not look at the stop.
  void tell(const std::string& stage, double fraction) {
    const std::lock_guard<std::mutex> lock(mutex_);
    fraction = std::clamp(fraction, 0.0, 1.0);
    if (fraction < last_) {
      base_ = done_;
      room_ = 0.5 * (1.0 - base_);
    }
    last_ = fraction;
    done_ = std::max(done_, base_ + room_ * fraction);
    if (context_.progress) context_.progress(stage, done_);
  }

 private:
  const Context& context_;
  std::mutex mutex_;
  double base_ = 0.0, room_, last_ = 0.0, done_ = 0.0;
};

}  // namespace dynid::detail
