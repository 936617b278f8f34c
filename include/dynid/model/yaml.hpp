// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dynid/model/coefficient.hpp"

namespace dynid {

/// Reads a model file, `format: dynid-model-1`. Throws Error `file:line: joints[3].com: what is wrong`,
/// joints being counted from 1, on anything unknown, missing, misplaced or not finite. Physical consistency
/// is not asked for here: see read_model_file() and inconsistencies().
///
/// The keys:
/// - `name`, `base_link`, `tip_link`: names.
/// - `tip`: pose of the tip in the last link's frame; the identity when left out.
/// - `gravity` [m/s^2], in the base frame.
/// - `note`: where the model comes from; may be left out.
/// - `physically_consistent`, `inconsistencies`: what inconsistencies() said when the file was
///   written; may be left out, and not relied upon.
/// - `joints`, base to tip, each with `name`, `link`, `type` (revolute, continuous, prismatic) and
///   `dh: {a, alpha, d, theta}` (Rx(alpha) Tx(a) Rz(theta + q) Tz(d); theta may be left out) or
///   `origin` (pose in the parent's link frame) with `axis`. What follows may be left out:
///   - `limits: {lower, upper, velocity, acceleration, jerk, torque, torque_rate}`: one left out is
///     none;
///   - `mass`, `com`, `inertia`, or `mass`, `first_moment`, `inertia_about_origin`: all left out is
///     zero;
///   - `friction`: `{viscous, coulomb, offset, velocity_scale}`, eq. (24), `{phi1, phi2, phi3}`,
///     eq. (25), or both in one;
///   - `rotor_inertia`.
/// - `effects`, what there is beyond rigid body and friction, each with `name`, `joints` (from 1) and
///   `parameters`, lists of numbers (see dynid::Effect); may be left out.
/// - `coefficients`, where the model was identified, each with `name`, `expression`, `value`,
///   `std_percent` (left out: not known, infinite) and `kept`.
/// - `uncertainty`, how far the residual strays without contact (see dynid::Uncertainty): `seconds`,
///   `window`, `motion: {bandwidth, period, position_noise}`, `tail: {level, scale, per_hour, count}`,
///   `joints`, one entry a joint with the fields of JointUncertainty, and `correlation`, the rows of its
///   lower triangle; may be left out.
///
/// A pose is `{xyz: [x, y, z], rpy: [roll, pitch, yaw]}` (URDF's: Rz(yaw) Ry(pitch) Rx(roll)) or
/// `{xyz: [x, y, z], quaternion: [x, y, z, w]}`; either part may be left out. Inertia is `{xx, xy,
/// xz, yy, yz, zz}`, a tensor in the axes of the link frame, about the centre of mass (`inertia`)
/// or the frame's origin.
ModelFile read_model(const std::string& path);

/// The same from a text; `name` stands for the file in what an Error says.
ModelFile parse_model(const std::string& text, const std::string& name);

/// The text of a model file. parse_model() of it gives the model back: the same doubles throughout, except
/// that origins given without a DH row, the tip, and the link parameters pass through angles and centres of
/// mass, and are the same to 1e-15 of their largest entries. Throws Error where validate() does, or when
/// joints share a name.
std::string to_yaml(const ModelFile& model);

/// Writes to_yaml(model) to `path`, whole or not at all. Throws Error.
void write_model(const std::string& path, const ModelFile& model);

}  // namespace dynid
