// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dynid/identification/conventions.hpp"

namespace dynid {

/// One line: what the log means instead, and the ~assume to give; empty where there is nothing to say.
std::string misread_text(const ConventionReport& report);

/// One message's worth of a robot, as it stands in the message.
struct JointSample {
  double t = 0.0;              ///< [s] stamp
  Eigen::VectorXd q, dq, tau;  ///< n
};

/// Asks a stream of joint states whether it means what the model takes it to mean, beside the loop: a window
/// of samples is kept, and find_conventions() asked once a quarter, a half and the whole of it is there, and
/// again with each window that follows.
class ReadingWatch {
 public:
  /// window [s]: of samples kept; 0: nothing is asked.
  ReadingWatch(int joints, double window);

  /// Takes a sample where it is later than the last one taken by the window's 3000th part. A stamp that goes
  /// back, or stays away for longer than the window, starts anew. Samples that are not finite are left out.
  void add(const JointSample& sample);
  /// Asks, where it is time to; says whether it did. `nominal`: as find_conventions() takes it, with what it
  /// carries.
  bool ask(const Robot& nominal);

  bool due() const noexcept { return !t_.empty() && t_.back() - t_.front() >= next_; }  ///< ask() would ask
  bool asked() const noexcept { return asked_; }
  /// What the last ask() found: empty, or one line with the ~assume to give.
  const std::string& text() const noexcept { return text_; }
  const ConventionReport& report() const noexcept { return report_; }

 private:
  void restart();

  int joints_;
  double window_, next_;  // [s]; next_: samples span this much when it is asked next
  std::vector<double> t_;
  std::vector<Eigen::VectorXd> rows_;  // q, dq, tau
  bool asked_ = false;
  ConventionReport report_;
  std::string text_;
};

}  // namespace dynid
