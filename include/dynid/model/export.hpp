// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid {

/// A robot in the words of another program, and what of the robot these cannot say, one line each.
struct ExportText {
  std::string text;
  std::vector<std::string> not_expressed;
};

/// The robot for MuJoCo (MJCF): nested bodies whose frames are the link frames, hinges and slides with range,
/// damping (viscous friction), frictionloss (Coulomb friction), armature (rotor inertia), stiffness and
/// springref (the effect joint_spring), one motor for each joint, limited where its torque is, the tip as a
/// site, gravity, all in SI units and rad.
///
/// A joint with a servo in SI units has an affine `general` actuator, which is what `position` with kp and kv
/// stands for and which every version reads: kp, kd, bias, torque limit and command filter; friction that
/// hardly gives way; and the model a short step of the implicit integrator. Actuators have the names of their
/// joints; those with a filter come last. Its delay, Stribeck friction and friction with the load, the
/// effects that MuJoCo has no words for, and a servo in ratios are listed.
///
/// Inertia is given along principal axes found here: MuJoCo's own are good to 1e-8 only. A base link
/// called `world` is MuJoCo's world body. Throws Error where validate() does, and when two joints or two
/// links share a name. A body that cannot exist is written as it is and listed: MuJoCo refuses it.
ExportText to_mjcf(const Robot& robot);

/// The robot as a model of SDF 1.7 (Gazebo, libsdformat 9 and later): links posed relative to their parents,
/// inertia along principal axes, the base fixed to the world, the tip as a frame. Gravity is a property of
/// the world, not of a model, and always listed.
///
/// Links, joints and frames of an SDF model share one set of names: a joint that is called as a link gets
/// another name, and is listed. A base link called `world` is the world itself. Throws Error and treats
/// bodies that cannot exist as to_mjcf() does.
ExportText to_sdf(const Robot& robot);

/// The inertials of the moving links as franka_description keeps them (`robots/ARM/inertials.yaml`): `link1`
/// to `linkn`, each with origin (centre of mass [m] in the link frame, no rotation), mass [kg] and inertia
/// about the centre of mass [kg m^2], in the axes of the link frame. Throws Error where validate() does.
ExportText to_franka_inertials(const Robot& robot);

/// The robot as a C++17 header of constexpr arrays in namespace `<name>_model`, which includes nothing of
/// this library: `make_robot<dynid::Robot>()` in it makes the same Robot (the DH rows aside), for Model<n>.
/// Throws Error where validate() does.
ExportText to_header(const Robot& robot);

}  // namespace dynid
