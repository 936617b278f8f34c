// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tuple>

#include "dynid/friction/linear.hpp"
#include "dynid/friction/sigmoid.hpp"

namespace dynid {

/// Laws that `--friction` names.
enum class FrictionLaw {
  none,
  linear,   ///< eq. (24): viscous, Coulomb, offset
  sigmoid,  ///< eq. (25)
};

/// Friction of one joint: the sum of its laws, each of which may be zero.
///
/// A law is a struct with what LinearFriction has, in a file of its own; it is registered by its member here,
/// which has the law's name, and by its place in laws(). Model files, exports, validation, prediction and
/// fits then know it.
struct JointFriction {
  LinearFriction linear;
  SigmoidFriction sigmoid;

  /// References to all laws, in the order in which files give their parameters.
  constexpr auto laws() noexcept { return std::tie(linear, sigmoid); }
  constexpr auto laws() const noexcept { return std::tie(linear, sigmoid); }

  /// [N m] at joint velocity dq [rad/s], on the motor's side of the balance: tau = M ddq + c + g + tau_f.
  double torque(double dq) const noexcept {
    return std::apply([dq](const auto&... law) { return (law.torque(dq) + ...); }, laws());
  }

  /// d tau_f / d dq [N m s/rad].
  double slope(double dq) const noexcept {
    return std::apply([dq](const auto&... law) { return (law.slope(dq) + ...); }, laws());
  }
};

/// True where a law makes any torque: where a parameter that it is proportional to is not zero.
template <class Law>
constexpr bool acts(const Law& law) noexcept {
  for (const auto& p : Law::parameters())
    if (p.role == FrictionRole::linear && law.*p.value != 0.0) return true;
  return false;
}

/// Calls `use(law, parameter)` for each parameter of each law of `friction` (a JointFriction, or any struct
/// that has laws()), in the order of files.
template <class Friction, class Use>
constexpr void for_each_parameter(Friction&& friction, Use&& use) {
  const auto of_law = [&use](auto& law) {
    for (const auto& parameter : law.parameters()) use(law, parameter);
  };
  std::apply([&of_law](auto&... law) { (of_law(law), ...); }, friction.laws());
}

}  // namespace dynid
