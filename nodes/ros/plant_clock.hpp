// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dynid {

/// When the cycles of a loop are due on a clock that the loop does not rule. A cycle that starts late is made
/// up for by cycles at half the period; where more than `longest_lag` has been lost, what was missed happens
/// unseen; and after more than `longest_stall` the loop's time stood still. Times in seconds, any origin.
class PlantClock {
 public:
  static constexpr double longest_lag = 0.02;
  static constexpr double longest_stall = 1.0;

  /// What happened since reset_statistics().
  struct Statistics {
    long cycles = 0;     ///< seen ones
    long late = 0;       ///< of those, more than a period after they were due
    long missed = 0;     ///< unseen ones
    long stalls = 0;     ///< longer than longest_stall
    double worst = 0.0;  ///< [s] latest start
  };

  /// The first cycle is due a period after `now`.
  PlantClock(double period, double now) noexcept
      : period_(period), due_(now), next_(now + period), earliest_(now) {}

  /// When to wake for the next cycle.
  double wake() const noexcept { return next_ > earliest_ ? next_ : earliest_; }

  /// The next cycle starts at `now`: returns how many cycles are to be run unseen before it.
  int begin(double now) noexcept {
    const double lag = now - next_;
    int unseen = 0;
    due_ = next_;
    if (lag > longest_stall) {
      due_ = now;
      ++statistics_.stalls;
    } else if (lag > longest_lag) {
      unseen = static_cast<int>(lag / period_);
      due_ += unseen * period_;
      statistics_.missed += unseen;
    }
    next_ = due_ + period_;
    earliest_ = now + 0.5 * period_;
    ++statistics_.cycles;
    if (lag > period_) ++statistics_.late;
    if (lag > statistics_.worst) statistics_.worst = lag;
    return unseen;
  }
  /// [s] when the cycle that started last was due: the time of what it computes.
  double due() const noexcept { return due_; }

  const Statistics& statistics() const noexcept { return statistics_; }
  void reset_statistics() noexcept { statistics_ = {}; }

 private:
  double period_, due_, next_, earliest_;
  Statistics statistics_;
};

}  // namespace dynid
