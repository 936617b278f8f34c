// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid {

/// What this library reads of a model that MuJoCo has compiled (mjModel), whatever MuJoCo's version: defaults
/// are resolved, angles in rad, inertias found. Plain data, filled from C or from Python. Indices from 0.
struct MjcfModel {
  struct Body {
    std::string name;
    int parent = 0;  ///< of body 0, the world: 0
    /// In the parent's frame, joints at their reference.
    alignas(64) Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    /// Centre of mass and principal axes, in the body's frame.
    alignas(64) Eigen::Isometry3d inertial = Eigen::Isometry3d::Identity();
    double mass = 0.0;                                            ///< [kg]
    Eigen::Vector3d principal_moments = Eigen::Vector3d::Zero();  ///< [kg m^2]
    double gravity_compensation = 0.0;                            ///< part of its weight that is held up
  };
  enum class JointKind { free, ball, slide, hinge };
  struct Joint {
    std::string name;
    JointKind kind = JointKind::hinge;
    int body = 0;
    Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  ///< [m], in the body's frame
    Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();   ///< in the body's frame
    double reference = 0.0;                            ///< position at which the body is at its pose
    double lower = -std::numeric_limits<double>::infinity();
    double upper = std::numeric_limits<double>::infinity();
    double torque_limit = std::numeric_limits<double>::infinity();  ///< of all actuators together
    double stiffness = 0.0, rest = 0.0;  ///< of its spring, about the position `rest`
    double damping = 0.0, friction_loss = 0.0, armature = 0.0;
  };
  struct Site {
    std::string name;
    int body = 0;
    alignas(64) Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< in the body's frame
  };
  /// Force = gain[0] x - or, where filtered, its filtered x - + bias . (1, length, speed), times `gear`.
  struct Actuator {
    std::string name;
    int joint = -1;       ///< that it acts on; -1: something else than a joint
    bool affine = false;  ///< the gain is fixed, the bias none or affine: motor, position, velocity
    bool filtered = false, stateful = false;  ///< first-order filter; any other activation
    double time_constant = 0.0;               ///< [s] of the filter
    double delay = 0.0;                       ///< [s]
    double gain = 0.0, gear = 1.0;
    std::array<double, 3> bias = {0.0, 0.0, 0.0};
    double lower = -std::numeric_limits<double>::infinity();  ///< of its force
    double upper = std::numeric_limits<double>::infinity();
  };
  std::string name;
  Eigen::Vector3d gravity = Eigen::Vector3d(0, 0, -9.81);  ///< [m/s^2], in the world's frame
  std::vector<Body> bodies;                                ///< the world first, parents before children
  std::vector<Joint> joints;                               ///< of each body in the order in which they act
  std::vector<Site> sites;
  std::vector<Actuator> actuators;
  int tendons = 0, equalities = 0;
  bool fluid = false;  ///< the medium has density or viscosity
};

/// A robot, and what of the model it cannot say, one line each.
struct MjcfRobot {
  Robot robot;
  std::vector<std::string> not_expressed;
};

/// The serial chain from `base` to `tip` of a compiled model.
///
/// `base` is a body, `tip` a body or a site. `base` left empty is the world's only child that carries moving
/// joints, or the world where that child moves itself (a free joint counts as none: the body is then the
/// base). `tip` left empty is found as parse_urdf() does. Other moving joints are frozen at their reference
/// and the bodies behind them lumped.
///
/// - A link frame has the axes of its body and its origin on the joint's anchor; joint positions are MuJoCo's
///   (qpos). The tip is the body's own frame, or the site. Of several joints of a body all but the last carry
///   links without mass.
/// - damping and frictionloss are viscous and Coulomb friction, armature the rotor inertia, a stiffness the
///   effect joint_spring; actuatorfrcrange, or a motor's forcerange or ctrlrange, the torque limit.
/// - A position actuator is the joint's Servo (kp, kd = kv, bias, torque_limit, delay, filter), its command
/// in
///   the joint's unit; a velocity actuator beside it adds to kd, its command being zero.
///
/// Allocates. Throws Error `name: ...`: an unknown base or tip, branches without a choice, a ball joint on
/// the way, no moving joint.
MjcfRobot robot_of(const MjcfModel& model, const std::string& name, const std::string& base = "",
                   const std::string& tip = "");

/// The MJCF of a file (or of `text`, which stands in it) as one text without its looks: includes put in,
/// files of meshes and height fields by absolute paths, textures, materials and keyframes left out, and so
/// are meshes whose files are not there with the geoms that show them. What is so left out makes no
/// difference where every body has an explicit `<inertial>`; where one that has none loses a geom, Error
/// names it. Throws Error `file:line: ...` on XML that is not well-formed, and on includes that cannot be
/// read.
struct MjcfText {
  std::string text;
  std::vector<std::string> missing;  ///< files that are not there
  /// kv of each `<position>` actuator, in their order among all actuators; those of other kinds 0. It is left
  /// out of the text: MuJoCo knows it from version 3 on.
  std::vector<double> position_kv;
};
MjcfText read_mjcf_text(const std::string& path);
MjcfText parse_mjcf_text(const std::string& text, const std::string& name);

/// The root element of an XML text is `mujoco`.
bool is_mjcf(const std::string& text);

/// Compiles a text with MuJoCo. Throws Error naming `name`, MuJoCo's version and what it says.
using MjcfCompiler = std::function<MjcfModel(const std::string& text, const std::string& name)>;

/// The MuJoCo in use: the one that this library was built with or, where there was none, one that a program
/// brings along (the Python package does), set before the first model is read. Empty: none. Not for several
/// threads.
void set_mjcf_compiler(MjcfCompiler compiler);
/// There is one.
bool has_mjcf_compiler();

/// Reads a file with the MuJoCo in use. `text`, if not null, is what is read in its place, `path` being its
/// name and its folder that of what it refers to. Throws Error as all of the above, and where there is no
/// MuJoCo.
MjcfRobot read_mjcf(const std::string& path, const std::string& base = "", const std::string& tip = "",
                    const std::string* text = nullptr);

}  // namespace dynid
