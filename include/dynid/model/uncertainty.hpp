// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "dynid/base/error.hpp"

namespace dynid {

struct ModelFile;

/// How far the residual of one joint strays where nothing touches the robot: in the window of Uncertainty it
/// has the variance
///   sigma^2 = constant + speed dq^2 + stiction / (1 + (dq / stiction_speed)^2) + load tau^2 + acceleration
///   ddq^2,
/// every coefficient >= 0. A joint that sticks has a friction anywhere within +-sticking of what the model
/// says: that is an interval of the residual, not a part of its variance.
struct JointUncertainty {
  double constant = 0.0;         ///< [(N m)^2], > 0
  double speed = 0.0;            ///< [(N m)^2 s^2]
  double stiction = 0.0;         ///< [(N m)^2]
  double load = 0.0;             ///< [1], of the model torque
  double acceleration = 0.0;     ///< [(N m)^2 s^4]
  double stiction_speed = 0.02;  ///< [rad/s], > 0; a joint slower than a tenth of it for 50 ms sticks
  double sticking = 0.0;         ///< [N m]
  double extent = 1.0;           ///< [m], > 0: size of the link, how likely it is the one that is met
  /// Where a push on the joint's link is looked for [m], in the link's frame.
  Eigen::Vector3d contact_point = Eigen::Vector3d::Zero();

  /// sigma^2 [(N m)^2] at dq [rad/s], tau (of the model) [N m], ddq [rad/s^2].
  double variance(double dq, double tau, double ddq) const noexcept {
    const double v = dq / stiction_speed;
    return constant + speed * dq * dq + stiction / (1.0 + v * v) + load * tau * tau +
           acceleration * ddq * ddq;
  }
};

/// At most how often the statistic of the ContactTest passes a value where nothing touches the robot: `level`
/// `per_hour` times an hour, level + x exp(-x / scale) times as often where the scale is known. Where it is
/// the mean of `count` values beyond the level: over all scales that may have made it (each as likely as its
/// double), level + x is passed (1 + x / (count scale))^-count times as often as the level.
struct ContactTail {
  double level = 0.0;     ///< > 0
  double scale = 0.0;     ///< > 0
  double per_hour = 0.0;  ///< > 0
  double count = 0.0;     ///< 0: the scale is known

  /// The statistic that is passed `rate` times an hour; at least the level.
  double threshold(double rate) const noexcept {
    const double x = std::max(0.0, std::log(per_hour / rate));
    return level + scale * (count > 0.0 ? count * std::expm1(x / count) : x);
  }
};

/// What a model knows of its own error, and how the log was measured that it was learnt from.
struct Uncertainty {
  std::vector<JointUncertainty> joints;  ///< base to tip
  Eigen::MatrixXd correlation;  ///< n x n of the residuals, each divided by its sigma; 1 on the diagonal
  double window = 80.0;         ///< [1/s] of the low-pass that the residual goes through, > 0
  // Of the MotionFilter.
  double motion_bandwidth = 100.0;  ///< [1/s], > 0
  double period = 0.0;              ///< [s] of the robot's clock; 0: the stamps are to be trusted
  double position_noise = 1e-5;     ///< [rad or m], > 0
  ContactTail tail;
  double seconds = 0.0;  ///< [s] of data that it was learnt from
};

/// Throws Error (`uncertainty: joint 2: speed must not be negative`) on a value out of range, and where the
/// joints are not `joints` many.
inline void validate(const Uncertainty& uncertainty, int joints) {
  const auto not_negative = [](double x, const std::string& what) {
    if (!(x >= 0.0) || !std::isfinite(x)) throw Error("uncertainty: " + what + " must not be negative");
  };
  const auto positive = [](double x, const std::string& what) {
    if (!(x > 0.0) || !std::isfinite(x)) throw Error("uncertainty: " + what + " must be positive");
  };
  if (static_cast<int>(uncertainty.joints.size()) != joints)
    throw Error("uncertainty: " + std::to_string(uncertainty.joints.size()) + " joints for a robot of " +
                std::to_string(joints));
  for (std::size_t i = 0; i < uncertainty.joints.size(); ++i) {
    const JointUncertainty& u = uncertainty.joints[i];
    const std::string joint = "joint " + std::to_string(i + 1) + ": ";
    positive(u.constant, joint + "constant");
    not_negative(u.speed, joint + "speed");
    not_negative(u.stiction, joint + "stiction");
    not_negative(u.load, joint + "load");
    not_negative(u.acceleration, joint + "acceleration");
    not_negative(u.sticking, joint + "sticking");
    positive(u.stiction_speed, joint + "stiction_speed");
    positive(u.extent, joint + "extent");
    if (!u.contact_point.allFinite()) throw Error("uncertainty: " + joint + "contact_point is not finite");
  }
  const Eigen::MatrixXd& C = uncertainty.correlation;
  if (C.rows() != joints || C.cols() != joints || !C.allFinite() || C != C.transpose() ||
      (C.diagonal().array() != 1.0).any() || C.llt().info() != Eigen::Success)
    throw Error("uncertainty: correlation is not a correlation matrix of " + std::to_string(joints) +
                " joints");
  positive(uncertainty.window, "window");
  positive(uncertainty.motion_bandwidth, "motion_bandwidth");
  not_negative(uncertainty.period, "period");
  positive(uncertainty.position_noise, "position_noise");
  positive(uncertainty.tail.level, "tail: level");
  positive(uncertainty.tail.scale, "tail: scale");
  positive(uncertainty.tail.per_hour, "tail: per_hour");
  not_negative(uncertainty.tail.count, "tail: count");
  not_negative(uncertainty.seconds, "seconds");
}

/// The `uncertainty` of a model file's text (see read_model()), nothing where it has none. `name` stands for
/// the file. Throws Error as parse_model().
std::optional<Uncertainty> parse_uncertainty(const std::string& text, const std::string& name);
/// The same of a file; nothing of one that is not a YAML model (a URDF).
std::optional<Uncertainty> read_uncertainty(const std::string& path);

/// The text of a model file that says how far its residual strays. parse_uncertainty() gives the same doubles
/// back. Throws Error as to_yaml() and validate().
std::string to_yaml(const ModelFile& model, const std::optional<Uncertainty>& uncertainty);
/// Writes it to `path`, whole or not at all. Throws Error.
void write_model(const std::string& path, const ModelFile& model,
                 const std::optional<Uncertainty>& uncertainty);

}  // namespace dynid
