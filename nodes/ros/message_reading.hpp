// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>

#include "dynid/identification/conventions.hpp"

namespace dynid {

/// How a stream of joint states is read, sample by sample: what ~assume says (see parse_assumptions()), as a
/// loop needs it. The gravity of an assumption is the model's affair, not that of a sample.
class MessageReading {
 public:
  MessageReading() = default;  ///< as the messages stand
  /// Throws Error, one line that begins with the key, for what no single sample can be read with: `auto`'s
  /// place is a whole log, stamps are in seconds, joints are found by name, a velocity and a sign that the
  /// message has not must be made of more than one sample.
  MessageReading(const Assumptions& assumptions, const Robot& robot);

  bool changes() const noexcept { return position_factor_.size() > 0; }
  /// Whether the gravity torque of the model is to be added to the torque.
  bool without_gravity() const noexcept { return without_gravity_; }
  /// q [rad or m], dq, tau [N m or N]: n each, as in the message, then as the model takes them; the gravity
  /// torque is not added here. Does not allocate.
  void apply(Eigen::VectorXd& q, Eigen::VectorXd& dq, Eigen::VectorXd& tau) const noexcept;

 private:
  Eigen::VectorXd position_factor_, zero_, velocity_factor_, torque_factor_;  // n, or empty: as it stands
  bool without_gravity_ = false;
};

/// parse_assumptions() of a text for a stream. Throws Error, also on `auto`.
Assumptions parse_stream_assumptions(const std::string& text, int joints);

}  // namespace dynid
