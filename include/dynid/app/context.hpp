// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <exception>
#include <functional>
#include <string>

namespace dynid {

/// Thrown out of a use case after a stop was requested: nothing was made, nothing was written. Not an Error:
/// nothing was wrong.
class Stopped : public std::exception {
 public:
  const char* what() const noexcept override { return "stopped on request"; }
};

/// How a use case tells what it is doing, and how it is stopped. A value: one for each run, nothing global.
struct Context {
  /// What is being done, and how much of the whole job is done, 0..1, never falling. Called from any thread,
  /// but never from two at once. What it throws ends the job, as a stop does.
  std::function<void(const std::string& stage, double fraction)> progress;
  /// Set it from any thread, or from a signal handler, to end the job: it throws Stopped where it next looks,
  /// at each report of progress at the latest. Has to outlive the job. Null: never stopped.
  const std::atomic<bool>* stop = nullptr;

  bool stop_requested() const noexcept { return stop != nullptr && stop->load(std::memory_order_relaxed); }
  /// Throws Stopped where a stop was requested.
  void check() const {
    if (stop_requested()) throw Stopped();
  }
  /// check(), then tells `progress`, if anyone listens.
  void report(const std::string& stage, double fraction) const {
    check();
    if (progress) progress(stage, fraction);
  }
  /// The context of a part of the job: its 0..1 are from..to of the whole. Holds a copy of this one.
  Context part(double from, double to) const;
};

}  // namespace dynid
