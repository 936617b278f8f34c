// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dynid {

/// How a fit finds a parameter of a friction law.
enum class FrictionRole {
  linear,     ///< the torque is proportional to it, the other linear ones being zero: solved for
  nonlinear,  ///< searched for within its range, then refined
  given,      ///< chosen by whoever fits; not negative
};

/// How the values tried of a nonlinear parameter lie in its range.
enum class FrictionSpacing {
  geometric,       ///< each a multiple of the one before
  dense_near_zero  ///< quadratically closer towards zero, with the sign of the end that they are nearer to
};

/// What is to be known of one parameter of the friction law `Law` by whoever reads, writes, checks or fits
/// it.
///
/// A range is a multiple of the joint's own speed: `least` and `most` times fastest^speed_power, `fastest`
/// [rad/s] being the largest speed in the samples.
template <class Law>
struct FrictionParameter {
  const char* key;     ///< in model files and JSON
  const char* symbol;  ///< among the coefficients, where the joint's number follows it
  double Law::*value;
  FrictionRole role = FrictionRole::linear;
  int speed_power = 0;  ///< from here on: of a nonlinear parameter alone
  double least = 0.0, most = 0.0;
  FrictionSpacing spacing = FrictionSpacing::geometric;
  int count = 0;  ///< values tried
};

}  // namespace dynid
