// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include "ros/estimator_core.hpp"
#include "ros/estimator_frames.hpp"
#include "ros/estimator_setup.hpp"
#include "ros/reading_watch.hpp"

namespace dynid {

/// The five statuses of torque_estimator_node in /diagnostics. A status speaks of the time since the one
/// before; its counts are from the start.
class EstimatorDiagnostics {
 public:
  using Wrapper = diagnostic_updater::DiagnosticStatusWrapper;

  /// joints: by name; silence [s]: without a message that is an error; contact_threshold [N m]: n.
  EstimatorDiagnostics(std::vector<std::string> joints, std::string topic, double silence)
      : joints_(std::move(joints)), topic_(std::move(topic)), silence_(silence) {}

  /// At the beginning of a report. `now` [s]: of a clock that only goes forward; publishers: of the topic.
  void begin(const EstimatorRecord& record, double now, int publishers);

  /// Rate, jitter, drops, and what was not answered and why.
  void input(Wrapper& status) const;
  /// Compute time, residual at rest, contact, what the estimator says of the last message.
  void output(Wrapper& status, const Eigen::VectorXd& contact_threshold) const;
  /// The file, whether bodies can have its parameters, what is not compensated.
  static void model(Wrapper& status, const EstimatorModel& model, const LinkInertia& payload,
                    const std::string& trouble);
  /// Where gravity and the frame of the wrench come from.
  static void frames(Wrapper& status, const EstimatorFrames& frames);
  /// Whether the messages mean what the model takes them to mean. window [s]: of the watch.
  static void reading(Wrapper& status, const ReadingWatch& watch, bool assumed, double window);

 private:
  std::string joint(int index) const;
  std::uint64_t since(Withheld why) const;

  std::vector<std::string> joints_;
  std::string topic_;
  double silence_;
  EstimatorRecord now_, before_;
  double time_ = -1.0, elapsed_ = 0.0, last_message_ = 0.0;
  int publishers_ = 0;
};

/// `bad_input, gap`; `ok` where no flag is set.
std::string describe(Status status);

}  // namespace dynid
