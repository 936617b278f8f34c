// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dynid {

/// What a cycle of the loop has to say: any number of flags, none of them is `ok`.
enum class Status : unsigned {
  ok = 0,
  restarted = 1u << 0,       ///< first sample, or the first after a reset: the observer starts from zero here
  bad_input = 1u << 1,       ///< not finite, of a wrong size, or ten times beyond a limit: outputs are held
  stale = 1u << 2,           ///< no time has passed, or the sample repeats the one before: outputs are held
  time_went_back = 1u << 3,  ///< dt < 0: reset
  gap = 1u << 4,             ///< more time has passed than allowed: reset
  limits_exceeded = 1u << 5,  ///< a position, velocity or torque is beyond the robot's limits
  near_singular = 1u << 6,    ///< the wrench is damped, see ExternalWrench
  model_changed = 1u << 7,    ///< another model is in use from this cycle on
};

constexpr Status operator|(Status a, Status b) noexcept {
  return static_cast<Status>(static_cast<unsigned>(a) | static_cast<unsigned>(b));
}
constexpr Status operator&(Status a, Status b) noexcept {
  return static_cast<Status>(static_cast<unsigned>(a) & static_cast<unsigned>(b));
}
constexpr Status& operator|=(Status& a, Status b) noexcept { return a = a | b; }
/// Whether any flag of `flags` is set in `status`.
constexpr bool has(Status status, Status flags) noexcept { return (status & flags) != Status::ok; }

}  // namespace dynid
