// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "dynid/base/error.hpp"
#include "dynid/friction/joint_friction.hpp"
#include "dynid/model/effect.hpp"
#include "dynid/model/link_inertia.hpp"
#include "dynid/model/servo.hpp"

namespace dynid {

enum class JointType { revolute, continuous, prismatic };

/// Modified Denavit-Hartenberg row (Khalil): Rx(alpha) Tx(a) Rz(theta + q) Tz(d) for a revolute joint,
/// Rx(alpha) Tx(a) Rz(theta) Tz(d + q) for a prismatic one.
struct ModifiedDh {
  double a = 0.0;      ///< [m]
  double alpha = 0.0;  ///< [rad]
  double d = 0.0;      ///< [m]
  double theta = 0.0;  ///< [rad]
};

/// Limits of one joint, rad (or m) and N m (or N); infinite where unknown.
struct JointLimits {
  double lower = -std::numeric_limits<double>::infinity();        ///< q_min
  double upper = std::numeric_limits<double>::infinity();         ///< q_max
  double velocity = std::numeric_limits<double>::infinity();      ///< |dq|
  double acceleration = std::numeric_limits<double>::infinity();  ///< |ddq|
  double jerk = std::numeric_limits<double>::infinity();          ///< |dddq|
  double torque = std::numeric_limits<double>::infinity();        ///< |tau|
  double torque_rate = std::numeric_limits<double>::infinity();   ///< |dtau/dt|
};

/// One moving joint and the link that it carries.
///
/// The pose of the link frame in its parent's link frame is `origin * Rot(axis, q)` (revolute, continuous) or
/// `origin * Trans(axis * q)` (prismatic): URDF's convention, which contains modified DH with axis = z.
struct Joint {
  std::string name;       ///< of the joint
  std::string link_name;  ///< of the link that the joint carries
  JointType type = JointType::revolute;
  /// Link frame at q = 0, in the parent's link frame. (Eigen aligns it by the vector unit compiled for;
  /// alignas keeps the layout one and the same in the library and in a program built with another -march.)
  alignas(64) Eigen::Isometry3d origin = Eigen::Isometry3d::Identity();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< unit vector, in the link frame
  std::optional<ModifiedDh> dh;                     ///< the row that `origin` came from, if any
  JointLimits limits;
  StandardParameters parameters = StandardParameters::Zero();  ///< of the link, in the link frame
  JointFriction friction;
  double rotor_inertia = 0.0;  ///< Ia [kg m^2], reflected to the joint side: adds Ia ddq to the torque
  std::optional<Servo> servo;  ///< of a position-controlled joint
};

/// A serial arm: what it is, not what it does. Plain data; see dynid::Model for the form that the kernels
/// read.
struct Robot {
  std::string name = "robot";
  std::string base_link = "base";
  std::string tip_link = "tip";
  std::vector<Joint> joints;  ///< base to tip
  alignas(64) Eigen::Isometry3d tip =
      Eigen::Isometry3d::Identity();  ///< pose of the tip (flange) in the last link's frame
  Eigen::Vector3d gravity = Eigen::Vector3d(0, 0, -9.81);  ///< [m/s^2], in the base frame
  std::vector<Effect> effects;  ///< beyond rigid body, rotor inertia and friction; the kernels know none

  int size() const noexcept { return static_cast<int>(joints.size()); }  ///< n, the number of joints
  Eigen::VectorXd parameters() const;                                    ///< pi, 10 n, links base to tip
  void set_parameters(const Eigen::VectorXd& pi);  ///< inverse of parameters(); throws Error
};

/// The pose `Rx(alpha) Tx(a) Rz(theta) Tz(d)`.
Eigen::Isometry3d pose(const ModifiedDh& dh);

/// A joint from a modified DH row: origin = pose(dh), axis = z; its link is called `<name>_link`.
Joint make_joint(const std::string& name, JointType type, const ModifiedDh& dh);

/// One broken rule of eqs. (11) and (16).
struct Inconsistency {
  int joint = 0;        ///< base to tip, from 1
  std::string link;     ///< link name
  std::string rule;     ///< in words, with the equation's number
  double margin = 0.0;  ///< negative: by how much it is broken, in the unit that the rule names
};

/// Every link's broken rules, base to tip; empty when the model is physically consistent. A link whose ten
/// parameters are all zero has no inertia at all and is passed over.
std::vector<Inconsistency> inconsistencies(const Robot& robot, double tolerance = 1e-9);

/// `link 'l2' (joint 2) breaks eq. (16): ... [kg m^2]: margin -0.01`: one line for a person.
std::string describe(const Inconsistency& broken);

/// Throws Error when a quantity of the robot is not finite, an axis is not a unit vector, an origin is not a
/// pose, position limits cross, another limit is not positive, an effect acts on a joint that there is not,
/// or there is no joint. Physical consistency is a separate question: see inconsistencies().
void validate(const Robot& robot);

/// The robot with a rigid body at its tip: `payload` is in the tip frame (mass [kg], com [m], inertia about
/// com). Throws Error when there is no joint.
Robot with_payload(const Robot& robot, const LinkInertia& payload);

}  // namespace dynid
