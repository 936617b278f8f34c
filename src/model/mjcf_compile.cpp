// SPDX-License-Identifier: Apache-2.0
//
// MuJoCo where this library was built with it (DYNID_WITH_MUJOCO), of any version from 2.2 on.
#include <memory>
#include <mutex>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/model/mjcf.hpp"
#ifdef DYNID_WITH_MUJOCO
#include <mujoco/mujoco.h>
#endif

namespace dynid {
namespace {

#ifdef DYNID_WITH_MUJOCO

Eigen::Vector3d mj_vector(const mjtNum* x) { return {x[0], x[1], x[2]}; }

Eigen::Isometry3d mj_pose(const mjtNum* position, const mjtNum* quaternion) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = mj_vector(position);
  pose.linear() = Eigen::Quaterniond(quaternion[0], quaternion[1], quaternion[2], quaternion[3])
                      .normalized()
                      .toRotationMatrix();
  return pose;
}

std::string mj_name(const mjModel& m, int type, int id) {
  const char* name = mj_id2name(&m, type, id);
  return name != nullptr ? name : "";
}

MjcfModel::Joint mj_joint(const mjModel& m, int j) {
  using Kind = MjcfModel::JointKind;
  MjcfModel::Joint joint;
  joint.name = mj_name(m, mjOBJ_JOINT, j);
  joint.kind = m.jnt_type[j] == mjJNT_FREE    ? Kind::free
               : m.jnt_type[j] == mjJNT_BALL  ? Kind::ball
               : m.jnt_type[j] == mjJNT_SLIDE ? Kind::slide
                                              : Kind::hinge;
  joint.body = m.jnt_bodyid[j];
  joint.anchor = mj_vector(m.jnt_pos + 3 * j);
  joint.axis = mj_vector(m.jnt_axis + 3 * j);
  joint.reference = m.qpos0[m.jnt_qposadr[j]];
  joint.rest = m.qpos_spring[m.jnt_qposadr[j]];
  joint.stiffness = m.jnt_stiffness[j];
  if (m.jnt_limited[j]) joint.lower = m.jnt_range[2 * j], joint.upper = m.jnt_range[2 * j + 1];
  const int dof = m.jnt_dofadr[j];
  joint.damping = m.dof_damping[dof];
  joint.friction_loss = m.dof_frictionloss[dof];
  joint.armature = m.dof_armature[dof];
#if mjVERSION_HEADER >= 300
  if (m.jnt_actfrclimited[j])
    joint.torque_limit = std::min(std::abs(m.jnt_actfrcrange[2 * j]), std::abs(m.jnt_actfrcrange[2 * j + 1]));
#endif
  return joint;
}

MjcfModel::Actuator mj_actuator(const mjModel& m, int a) {
  MjcfModel::Actuator actuator;
  actuator.name = mj_name(m, mjOBJ_ACTUATOR, a);
  if (m.actuator_trntype[a] == mjTRN_JOINT || m.actuator_trntype[a] == mjTRN_JOINTINPARENT)
    actuator.joint = m.actuator_trnid[2 * a];
  const bool biased = m.actuator_biastype[a] == mjBIAS_AFFINE;
  actuator.affine =
      m.actuator_gaintype[a] == mjGAIN_FIXED && (biased || m.actuator_biastype[a] == mjBIAS_NONE);
  actuator.filtered = m.actuator_dyntype[a] == mjDYN_FILTER;
#if mjVERSION_HEADER >= 300
  actuator.filtered = actuator.filtered || m.actuator_dyntype[a] == mjDYN_FILTEREXACT;
#endif
  actuator.stateful = m.actuator_dyntype[a] != mjDYN_NONE && !actuator.filtered;
  if (actuator.filtered) actuator.time_constant = m.actuator_dynprm[mjNDYN * a];
#if mjVERSION_HEADER >= 4000000
  actuator.delay = m.actuator_delay[a];
#endif
  actuator.gain = m.actuator_gainprm[mjNGAIN * a];
  actuator.gear = m.actuator_gear[6 * a];
  for (int k = 0; biased && k < 3; ++k)
    actuator.bias[static_cast<std::size_t>(k)] = m.actuator_biasprm[mjNBIAS * a + k];
  if (m.actuator_forcelimited[a])
    actuator.lower = m.actuator_forcerange[2 * a], actuator.upper = m.actuator_forcerange[2 * a + 1];
  return actuator;
}

MjcfModel arrays_of(const mjModel& m) {
  MjcfModel model;
  model.name = m.names;  // the first name is the model's
  model.gravity =
      (m.opt.disableflags & mjDSBL_GRAVITY) != 0 ? Eigen::Vector3d::Zero() : mj_vector(m.opt.gravity);
  model.fluid = m.opt.density != 0.0 || m.opt.viscosity != 0.0;
  model.tendons = static_cast<int>(m.ntendon);
  model.equalities = static_cast<int>(m.neq);
  for (int b = 0; b < m.nbody; ++b) {
    MjcfModel::Body body;
    body.name = mj_name(m, mjOBJ_BODY, b);
    if (body.name.empty()) body.name = "body" + std::to_string(b);
    body.parent = m.body_parentid[b];
    body.pose = mj_pose(m.body_pos + 3 * b, m.body_quat + 4 * b);
    body.inertial = mj_pose(m.body_ipos + 3 * b, m.body_iquat + 4 * b);
    body.mass = m.body_mass[b];
    body.principal_moments = mj_vector(m.body_inertia + 3 * b);
#if mjVERSION_HEADER >= 300
    body.gravity_compensation = m.body_gravcomp[b];
#endif
    model.bodies.push_back(body);
  }
  for (int j = 0; j < m.njnt; ++j) model.joints.push_back(mj_joint(m, j));
  for (int s = 0; s < m.nsite; ++s)
    model.sites.push_back(
        {mj_name(m, mjOBJ_SITE, s), m.site_bodyid[s], mj_pose(m.site_pos + 3 * s, m.site_quat + 4 * s)});
#if mjVERSION_HEADER >= 4000000
  const int actuators = static_cast<int>(m.nactuator);
#else
  const int actuators = static_cast<int>(m.nu);
#endif
  for (int a = 0; a < actuators; ++a) model.actuators.push_back(mj_actuator(m, a));
  return model;
}

/// What MuJoCo says in several lines, of which those of its own text mean nothing to anyone.
std::string without_line(std::string text) {
  text = one_line(text);
  const auto at = text.find(", line ");
  if (at != std::string::npos) {
    auto end = at + 7;
    while (end < text.size() && text[end] >= '0' && text[end] <= '9') ++end;
    text.erase(at, end - at);
  }
  return text;
}

MjcfModel compile_with_libmujoco(const std::string& text, const std::string& name) {
  static std::mutex mutex;  // its parser and its handlers are one for the whole process
  const std::lock_guard<std::mutex> lock(mutex);
  void (*const warn)(const char*) = mju_user_warning;
  mju_user_warning = [](const char*) {};
  const auto vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
#if mjVERSION_HEADER >= 310
  mj_addBufferVFS(vfs.get(), "robot.xml", text.data(), static_cast<int>(text.size()));
#else
  mj_makeEmptyFileVFS(vfs.get(), "robot.xml", static_cast<int>(text.size()));
  std::copy(text.begin(), text.end(), static_cast<char*>(vfs->filedata[0]));
#endif
  char error[1000] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> m(
      mj_loadXML("robot.xml", vfs.get(), error, sizeof(error)), &mj_deleteModel);
  mj_deleteVFS(vfs.get());
  mju_user_warning = warn;
  if (!m)
    throw Error(name + ": MuJoCo " + mj_versionString() +
                ", with which this dynid was built, refuses it: " + without_line(error));
  return arrays_of(*m);
}

MjcfCompiler& mjcf_compiler() {
  static MjcfCompiler compiler = compile_with_libmujoco;
  return compiler;
}

#else

MjcfCompiler& mjcf_compiler() {
  static MjcfCompiler compiler;
  return compiler;
}

#endif

}  // namespace

void set_mjcf_compiler(MjcfCompiler compiler) { mjcf_compiler() = std::move(compiler); }

bool has_mjcf_compiler() { return mjcf_compiler() != nullptr; }

MjcfRobot read_mjcf(const std::string& path, const std::string& base, const std::string& tip,
                    const std::string* text) {
  if (!mjcf_compiler())
    throw Error(path + ": this is an MJCF, and this dynid was built without MuJoCo (Debian: libmujoco-dev)");
  const MjcfText mjcf = text != nullptr ? parse_mjcf_text(*text, path) : read_mjcf_text(path);
  MjcfModel model = mjcf_compiler()(mjcf.text, path);
  if (mjcf.position_kv.size() == model.actuators.size())
    for (std::size_t a = 0; a < model.actuators.size(); ++a)
      model.actuators[a].bias[2] -= mjcf.position_kv[a];
  return robot_of(model, path, base, tip);
}

}  // namespace dynid
