// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/model/robot.hpp"

namespace dynid {

/// The serial chain from `base` to `tip` of a URDF (urdfdom).
///
/// `base` and `tip` are links; `base` left empty is the root. `tip` left empty is found by going on from the
/// base: at each link to the one child beyond which there is a moving joint, or, where there is none, to an
/// only child. Where two children lead to moving joints the Error lists the leaves to choose from.
///
/// - Link frames, joint origins and axes are the URDF's (an axis is normalised). Revolute,
///   continuous and prismatic joints move; fixed ones are lumped: the bodies behind them go into
///   the moving link that carries them, those before the first moving joint are dropped with the
///   base.
/// - Moving joints that are not on the way from base to tip (the fingers of a gripper) are frozen
///   at position zero, and the bodies behind them lumped in the same way.
/// - Gravity is (0, 0, -9.81) m/s^2 in the root's frame, turned into the base's (joints between
///   them at zero).
/// - `<dynamics damping friction>` are viscous and Coulomb friction. A limit on velocity or effort
///   that is zero, position limits that are both zero, and every limit of at least 1e16 mean that
///   there is none.
/// Throws Error, one line, with `name` and where possible the line: malformed XML, what urdfdom refuses, a
/// loop, an unknown base or tip, a floating, planar or mimic joint on the way, an axis without direction, no
/// moving joint, numbers that are not finite. Physical consistency is not asked for here: see read_robot()
/// and inconsistencies().
Robot parse_urdf(const std::string& text, const std::string& name, const std::string& base = "",
                 const std::string& tip = "");

/// The same from a file, which is the `name`.
Robot read_urdf(const std::string& path, const std::string& base = "", const std::string& tip = "");

/// A URDF, and what of the robot it cannot say, one line each.
struct UrdfText {
  std::string text;
  std::vector<std::string> not_expressed;
};

/// The robot as a URDF: parse_urdf() of it gives the same robot, to 1e-14 of its numbers, but for what
/// `not_expressed` lists. The tip is a link behind a fixed joint unless it is the last link itself. A
/// revolute joint without position limits is written as continuous; other limits that are not known as 1e16.
/// Throws Error where validate() does, and when two joints or two links share a name.
UrdfText to_urdf(const Robot& robot);

/// `text`, a URDF, with the inertia and the friction of `robot`, and otherwise left as it is, byte for byte:
/// only
/// `<inertial>` of the moving links on the way from base to tip, and damping and friction of their joints'
/// `<dynamics>`, are rewritten (or put in where they are missing).
///
/// Bodies that parse_urdf() lumps into a moving link keep their own `<inertial>`, and the moving link gets
/// the rest, so that parse_urdf() of the result gives the parameters of `robot`. Joints are matched by name,
/// from `robot.base_link` to `robot.tip_link` where the URDF knows these links. Throws Error as parse_urdf()
/// does, and when a joint or its frame is not the URDF's.
UrdfText update_urdf(const std::string& text, const std::string& name, const Robot& robot);

}  // namespace dynid
