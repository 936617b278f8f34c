// SPDX-License-Identifier: Apache-2.0
//
// dynid.Robot: reading, what it is, and the kernels on one state and on many.
#include <nanobind/eigen/dense.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <sstream>

#include "app/serialise.hpp"
#include "binding.hpp"
#include "dynid/app/info.hpp"
#include "dynid/app/text.hpp"
#include "dynid/base/file.hpp"
#include "dynid/model/mjcf.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/model/yaml.hpp"
#include "loaded_kernels.hpp"

namespace dynid::python {
namespace {

using nb::literals::operator""_a;

/// Rows of numbers, one state or one state a row: taken as they lie where they are float64 and row by row.
using Rows = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

/// Owned by Python from here on.
nb::object give_array(std::unique_ptr<double[]> data, std::vector<std::size_t> shape) {
  double* const values = data.release();
  const nb::capsule owner(values, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, double>(values, shape.size(), shape.data(), owner));
}

/// An array that NumPy makes, its entries not set.
nb::object numpy_array(const std::vector<std::size_t>& shape) {
  nb::list lengths;
  for (const std::size_t k : shape) lengths.append(k);
  return nb::module_::import_("numpy").attr("empty")(nb::tuple(lengths));
}

/// How many states there are, and whether they came as rows.
std::size_t count_of(const PyRobot& robot, const Rows& x, const char* name, bool& batch) {
  const auto n = static_cast<std::size_t>(robot.model.robot.size());
  batch = x.ndim() == 2;
  if ((x.ndim() != 1 && x.ndim() != 2) || x.shape(x.ndim() - 1) != n)
    throw Error(std::string(name) + ": shape (" + std::to_string(n) + ",) or (samples, " + std::to_string(n) +
                ") is expected");
  return batch ? x.shape(0) : 1;
}

void check_alike(const PyRobot& robot, const Rows& x, const Rows& q, const char* name) {
  bool batch = false;
  count_of(robot, q, "q", batch);  // q first: the others are measured by it
  bool alike = x.ndim() == q.ndim();
  for (std::size_t k = 0; alike && k < q.ndim(); ++k) alike = x.shape(k) == q.shape(k);
  if (!alike) throw Error(std::string(name) + ": another shape than q");
}

/// The caller's array for a result: taken as it lies, never converted.
double* place_of(nb::handle out, const std::vector<std::size_t>& shape) {
  nb::ndarray<double, nb::c_contig, nb::device::cpu> place;
  bool fits = nb::try_cast(out, place, false) && place.ndim() == shape.size();
  for (std::size_t k = 0; fits && k < shape.size(); ++k) fits = place.shape(k) == shape[k];
  if (fits) return place.data();
  std::string wanted;
  for (const std::size_t k : shape) wanted += (wanted.empty() ? "" : ", ") + std::to_string(k);
  throw Error("out: a writable float64 array that lies row by row is expected, of shape (" + wanted +
              (shape.size() == 1 ? ",)" : ")"));
}

/// Makes the array of a kernel, or fills `into` where that is not None: `per_sample` is the shape of one
/// state's result.
template <class Use>
nb::object evaluate(const PyRobot& robot, const Rows& q, std::vector<std::size_t> per_sample, nb::handle into,
                    Use use) {
  bool batch = false;
  const std::size_t count = count_of(robot, q, "q", batch);
  if (batch) per_sample.insert(per_sample.begin(), count);
  std::size_t size = 1;
  for (const std::size_t k : per_sample) size *= k;
  // A batch is NumPy's own memory, which asks for huge pages where it is large: ordinary ones cost a third of
  // rnea.
  const nb::object made = !into.is_none() ? nb::borrow(into) : batch ? numpy_array(per_sample) : nb::none();
  std::unique_ptr<double[]> single;
  if (made.is_none()) single.reset(new double[size]);  // every entry is written
  double* const out = single ? single.get() : place_of(made, per_sample);
  {
    const nb::gil_scoped_release release;
    if (count > 0) use(static_cast<std::ptrdiff_t>(count), out);
  }
  return single ? give_array(std::move(single), per_sample) : made;
}

template <class Use>
nb::object evaluate(const PyRobot& robot, const Rows& q, std::vector<std::size_t> per_sample, Use use) {
  return evaluate(robot, q, std::move(per_sample), nb::none(), use);
}

const double* armature_of(const PyRobot& robot, bool rotor_inertia) {
  return rotor_inertia && robot.armature.size() > 0 && !robot.armature.isZero(0.0) ? robot.armature.data()
                                                                                   : nullptr;
}

void bind_kernels(nb::class_<PyRobot>& robot) {
  robot
      .def(
          "rnea",
          [](const PyRobot& r, const Rows& q, const Rows& dq, const Rows& ddq, bool rotor_inertia,
             nb::handle out) {
            check_alike(r, dq, q, "dq");
            check_alike(r, ddq, q, "ddq");
            const auto n = static_cast<std::size_t>(r.model.robot.size());
            return evaluate(r, q, {n}, out, [&](std::ptrdiff_t count, double* tau) {
              kernels().rnea(r.model.robot, count, q.data(), dq.data(), ddq.data(),
                             armature_of(r, rotor_inertia), tau);
            });
          },
          "q"_a, "dq"_a, "ddq"_a, nb::kw_only(), "rotor_inertia"_a = true, "out"_a = nb::none(),
          "Inverse dynamics [N m or N]: M(q) ddq + S(q, dq) dq + g(q), without friction.\n\n"
          "q [rad or m], dq [rad/s or m/s], ddq [rad/s^2 or m/s^2]: shape (n,), or (samples, n); joints base "
          "to tip.\n"
          "Returns the same shape. Rotor inertias are part of M unless rotor_inertia=False. float64 arrays "
          "that lie\n"
          "row by row are not copied; the GIL is released. `out`: such an array of that shape, filled and "
          "returned.")
      .def(
          "regressor",
          [](const PyRobot& r, const Rows& q, const Rows& dq, const Rows& ddq) {
            check_alike(r, dq, q, "dq");
            check_alike(r, ddq, q, "ddq");
            const auto n = static_cast<std::size_t>(r.model.robot.size());
            return evaluate(r, q, {n, 10 * n}, [&](std::ptrdiff_t count, double* out) {
              kernels().regressor(r.model.robot, count, q.data(), dq.data(), ddq.data(), out);
            });
          },
          "q"_a, "dq"_a, "ddq"_a,
          "Y(q, dq, ddq) with Y @ parameters = rnea without rotor inertia: shape (n, 10 n), or (samples, n, "
          "10 n).\n\n"
          "Columns: m, mx, my, mz, xx, xy, yy, xz, yz, zz of each link, base to tip (see `parameters`).")
      .def(
          "mass_matrix",
          [](const PyRobot& r, const Rows& q, bool rotor_inertia) {
            const auto n = static_cast<std::size_t>(r.model.robot.size());
            return evaluate(r, q, {n, n}, [&](std::ptrdiff_t count, double* out) {
              kernels().mass_matrix(r.model.robot, count, q.data(), armature_of(r, rotor_inertia), out);
            });
          },
          "q"_a, nb::kw_only(), "rotor_inertia"_a = true,
          "Mass matrix M(q) [kg m^2], rotor inertias on its diagonal unless rotor_inertia=False.\n\n"
          "q [rad or m]: shape (n,), or (samples, n). Returns (n, n), or (samples, n, n).")
      .def(
          "coriolis",
          [](const PyRobot& r, const Rows& q, const Rows& dq) {
            check_alike(r, dq, q, "dq");
            const auto n = static_cast<std::size_t>(r.model.robot.size());
            return evaluate(r, q, {n, n}, [&](std::ptrdiff_t count, double* out) {
              kernels().coriolis(r.model.robot, count, q.data(), dq.data(), out);
            });
          },
          "q"_a, "dq"_a,
          "Coriolis matrix S(q, dq) by Christoffel's symbols: S dq is the torque of the velocities, dM/dt - "
          "2 S is\n"
          "skew. q [rad or m], dq: shape (n,), or (samples, n). Returns (n, n), or (samples, n, n).")
      .def(
          "gravity_torque",
          [](const PyRobot& r, const Rows& q) {
            const auto n = static_cast<std::size_t>(r.model.robot.size());
            return evaluate(r, q, {n}, [&](std::ptrdiff_t count, double* out) {
              kernels().gravity(r.model.robot, count, q.data(), out);
            });
          },
          "q"_a, "Gravity torque g(q) [N m or N]: what it takes to hold the arm. q: (n,), or (samples, n).")
      .def(
          "forward_dynamics",
          [](const PyRobot& r, const Rows& q, const Rows& dq, const Rows& tau, bool rotor_inertia) {
            check_alike(r, dq, q, "dq");
            check_alike(r, tau, q, "tau");
            const auto n = static_cast<std::size_t>(r.model.robot.size());
            return evaluate(r, q, {n}, [&](std::ptrdiff_t count, double* out) {
              kernels().forward(r.model.robot, count, q.data(), dq.data(), tau.data(),
                                armature_of(r, rotor_inertia), out);
            });
          },
          "q"_a, "dq"_a, "tau"_a, nb::kw_only(), "rotor_inertia"_a = true,
          "Accelerations [rad/s^2 or m/s^2] under the torques tau [N m or N], friction already taken off.\n\n"
          "q [rad or m], dq, tau: shape (n,), or (samples, n). Returns the same shape.")
      .def(
          "jacobian",
          [](const PyRobot& r, const Rows& q) {
            const auto n = static_cast<std::size_t>(r.model.robot.size());
            return evaluate(r, q, {6, n}, [&](std::ptrdiff_t count, double* out) {
              kernels().jacobian(r.model.robot, count, q.data(), out);
            });
          },
          "q"_a,
          "Geometric Jacobian of the tip: J dq is its velocity [m/s] (rows 0-2) and angular velocity [rad/s] "
          "(rows\n"
          "3-5), both in the axes of the base. q: (n,), or (samples, n). Returns (6, n), or (samples, 6, n).")
      .def(
          "friction_torque",
          [](const PyRobot& r, const Eigen::Ref<const Eigen::MatrixXd>& dq) {
            Eigen::MatrixXd tau = dq;
            if (dq.cols() != r.model.robot.size()) throw Error("dq: shape (samples, n) is expected");
            for (Eigen::Index j = 0; j < dq.cols(); ++j)
              for (Eigen::Index i = 0; i < dq.rows(); ++i)
                tau(i, j) = r.model.robot.joints[static_cast<std::size_t>(j)].friction.torque(dq(i, j));
            return tau;
          },
          "dq"_a, "Joint friction [N m] at dq [rad/s], shape (samples, n): tau = rnea + friction_torque.");
}

// ------------------------------------------------------------------------------------------- compiled MuJoCo
// models

std::vector<double> numbers(nb::handle model, const char* name) {
  return nb::cast<std::vector<double>>(
      model.attr(name).attr("astype")("float64").attr("ravel")().attr("tolist")());
}

Eigen::Vector3d vector_at(const std::vector<double>& x, std::size_t k) {
  return {x.at(3 * k), x.at(3 * k + 1), x.at(3 * k + 2)};
}

Eigen::Isometry3d pose_at(const std::vector<double>& positions, const std::vector<double>& quaternions,
                          std::size_t k) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = vector_at(positions, k);
  pose.linear() = Eigen::Quaterniond(quaternions.at(4 * k), quaternions.at(4 * k + 1),
                                     quaternions.at(4 * k + 2), quaternions.at(4 * k + 3))
                      .normalized()
                      .toRotationMatrix();
  return pose;
}

/// Values of MuJoCo's enumerations by their names.
class MujocoWords {
 public:
  MujocoWords() : mujoco_(nb::module_::import_("mujoco")) {}
  int operator()(const char* enumeration, const char* value) const {
    const nb::object all = mujoco_.attr(enumeration);
    return nb::hasattr(all, value) ? nb::cast<int>(nb::int_(all.attr(value))) : -1;
  }
  std::string name_of(nb::handle model, int type, std::size_t id) const {
    const nb::object name = mujoco_.attr("mj_id2name")(model, type, static_cast<int>(id));
    return name.is_none() ? "" : nb::cast<std::string>(name);
  }

 private:
  nb::module_ mujoco_;
};

void take_joints(nb::handle m, const MujocoWords& word, MjcfModel& model) {
  using Kind = MjcfModel::JointKind;
  const auto type = numbers(m, "jnt_type"), body = numbers(m, "jnt_bodyid"), pos = numbers(m, "jnt_pos"),
             axis = numbers(m, "jnt_axis"), limited = numbers(m, "jnt_limited"),
             range = numbers(m, "jnt_range"), address = numbers(m, "jnt_qposadr"),
             dof = numbers(m, "jnt_dofadr"), stiffness = numbers(m, "jnt_stiffness"),
             reference = numbers(m, "qpos0"), rest = numbers(m, "qpos_spring"),
             damping = numbers(m, "dof_damping"), friction = numbers(m, "dof_frictionloss"),
             armature = numbers(m, "dof_armature");
  std::vector<double> force_limited, force_range;
  if (nb::hasattr(m, "jnt_actfrclimited"))
    force_limited = numbers(m, "jnt_actfrclimited"), force_range = numbers(m, "jnt_actfrcrange");
  for (std::size_t j = 0; j < type.size(); ++j) {
    MjcfModel::Joint joint;
    const int kind = static_cast<int>(type[j]);
    joint.kind = kind == word("mjtJoint", "mjJNT_FREE")    ? Kind::free
                 : kind == word("mjtJoint", "mjJNT_BALL")  ? Kind::ball
                 : kind == word("mjtJoint", "mjJNT_SLIDE") ? Kind::slide
                                                           : Kind::hinge;
    joint.name = word.name_of(m, word("mjtObj", "mjOBJ_JOINT"), j);
    joint.body = static_cast<int>(body[j]);
    joint.anchor = vector_at(pos, j);
    joint.axis = vector_at(axis, j);
    const auto at = static_cast<std::size_t>(address[j]), d = static_cast<std::size_t>(dof[j]);
    joint.reference = reference[at];
    joint.rest = rest[at];
    // From version 3.4 on it may be one of several coefficients a joint.
    joint.stiffness = stiffness[j * (stiffness.size() / type.size())];
    if (limited[j] != 0.0) joint.lower = range[2 * j], joint.upper = range[2 * j + 1];
    if (!force_limited.empty() && force_limited[j] != 0.0)
      joint.torque_limit = std::min(std::abs(force_range[2 * j]), std::abs(force_range[2 * j + 1]));
    joint.damping = damping[d];
    joint.friction_loss = friction[d];
    joint.armature = armature[d];
    model.joints.push_back(joint);
  }
}

void take_actuators(nb::handle m, const MujocoWords& word, MjcfModel& model) {
  const auto transmission = numbers(m, "actuator_trntype"), target = numbers(m, "actuator_trnid"),
             gain_type = numbers(m, "actuator_gaintype"), bias_type = numbers(m, "actuator_biastype"),
             dynamics = numbers(m, "actuator_dyntype"), dynamic = numbers(m, "actuator_dynprm"),
             gain = numbers(m, "actuator_gainprm"), bias = numbers(m, "actuator_biasprm"),
             gear = numbers(m, "actuator_gear"), limited = numbers(m, "actuator_forcelimited"),
             range = numbers(m, "actuator_forcerange");
  std::vector<double> delay;
  if (nb::hasattr(m, "actuator_delay")) delay = numbers(m, "actuator_delay");
  const std::size_t count = transmission.size();
  for (std::size_t a = 0; a < count; ++a) {
    MjcfModel::Actuator actuator;
    actuator.name = word.name_of(m, word("mjtObj", "mjOBJ_ACTUATOR"), a);
    const int kind = static_cast<int>(transmission[a]);
    if (kind == word("mjtTrn", "mjTRN_JOINT") || kind == word("mjtTrn", "mjTRN_JOINTINPARENT"))
      actuator.joint = static_cast<int>(target[2 * a]);
    const bool biased = static_cast<int>(bias_type[a]) == word("mjtBias", "mjBIAS_AFFINE");
    actuator.affine = static_cast<int>(gain_type[a]) == word("mjtGain", "mjGAIN_FIXED") &&
                      (biased || static_cast<int>(bias_type[a]) == word("mjtBias", "mjBIAS_NONE"));
    const int activation = static_cast<int>(dynamics[a]);
    actuator.filtered =
        activation == word("mjtDyn", "mjDYN_FILTER") || activation == word("mjtDyn", "mjDYN_FILTEREXACT");
    actuator.stateful = activation != word("mjtDyn", "mjDYN_NONE") && !actuator.filtered;
    if (actuator.filtered) actuator.time_constant = dynamic[a * (dynamic.size() / count)];
    if (!delay.empty()) actuator.delay = delay[a];
    actuator.gain = gain[a * (gain.size() / count)];
    actuator.gear = gear[a * (gear.size() / count)];
    for (std::size_t k = 0; biased && k < 3; ++k) actuator.bias[k] = bias[a * (bias.size() / count) + k];
    if (limited[a] != 0.0) actuator.lower = range[2 * a], actuator.upper = range[2 * a + 1];
    model.actuators.push_back(actuator);
  }
}

/// What the library reads of a mujoco.MjModel.
MjcfModel arrays_of(nb::handle m) {
  const MujocoWords word;
  MjcfModel model;
  const auto names = nb::cast<nb::bytes>(m.attr("names"));
  model.name = std::string(names.c_str());  // the first name is the model's
  const nb::object option = m.attr("opt");
  model.gravity = vector_at(numbers(option, "gravity"), 0);
  if ((nb::cast<int>(option.attr("disableflags")) & word("mjtDisableBit", "mjDSBL_GRAVITY")) != 0)
    model.gravity.setZero();
  model.fluid =
      nb::cast<double>(option.attr("density")) != 0.0 || nb::cast<double>(option.attr("viscosity")) != 0.0;
  model.tendons = nb::cast<int>(m.attr("ntendon"));
  model.equalities = nb::cast<int>(m.attr("neq"));
  const auto parent = numbers(m, "body_parentid"), pos = numbers(m, "body_pos"),
             quat = numbers(m, "body_quat"), ipos = numbers(m, "body_ipos"), iquat = numbers(m, "body_iquat"),
             mass = numbers(m, "body_mass"), moments = numbers(m, "body_inertia");
  std::vector<double> compensation(parent.size(), 0.0);
  if (nb::hasattr(m, "body_gravcomp")) compensation = numbers(m, "body_gravcomp");
  for (std::size_t b = 0; b < parent.size(); ++b) {
    MjcfModel::Body body;
    body.name = word.name_of(m, word("mjtObj", "mjOBJ_BODY"), b);
    if (body.name.empty()) body.name = "body" + std::to_string(b);
    body.parent = static_cast<int>(parent[b]);
    body.pose = pose_at(pos, quat, b);
    body.inertial = pose_at(ipos, iquat, b);
    body.mass = mass[b];
    body.principal_moments = vector_at(moments, b);
    body.gravity_compensation = compensation[b];
    model.bodies.push_back(body);
  }
  take_joints(m, word, model);
  const auto site_body = numbers(m, "site_bodyid"), site_pos = numbers(m, "site_pos"),
             site_quat = numbers(m, "site_quat");
  for (std::size_t s = 0; s < site_body.size(); ++s)
    model.sites.push_back({word.name_of(m, word("mjtObj", "mjOBJ_SITE"), s), static_cast<int>(site_body[s]),
                           pose_at(site_pos, site_quat, s)});
  take_actuators(m, word, model);
  return model;
}

// ------------------------------------------------------------------------------------------------------
// reading

Consistency consistency_of(bool allow_inconsistent) {
  return allow_inconsistent ? Consistency::ignore : Consistency::refuse;
}

PyRobot from_file(const std::string& path, const std::string& base, const std::string& tip,
                  bool allow_inconsistent) {
  return PyRobot(read_model_file(path, base, tip, consistency_of(allow_inconsistent)), path);
}

PyRobot from_text(const std::string& text, const std::string& name, const std::string& base,
                  const std::string& tip) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos || text[first] != '<') return PyRobot(parse_model(text, name), name);
  if (!is_mjcf(text)) return PyRobot({parse_urdf(text, name, base, tip), {}, ""}, name);
  MjcfRobot read = read_mjcf(name, base, tip, &text);
  PyRobot robot({read.robot, {}, ""}, name);
  robot.not_expressed = read.not_expressed;
  return robot;
}

PyRobot from_mujoco(nb::handle model, const std::string& base, const std::string& tip) {
  const MjcfModel arrays = arrays_of(model);
  const std::string name = arrays.name.empty() ? "MjModel" : arrays.name;
  MjcfRobot read = robot_of(arrays, name, base, tip);
  PyRobot robot({read.robot, {}, ""}, name);
  robot.not_expressed = read.not_expressed;
  return robot;
}

PyRobot from_dh(const std::vector<std::array<double, 4>>& rows, const std::string& types,
                const std::string& name) {
  if (!types.empty() && types.size() != rows.size()) throw Error("types: one letter, r or p, for each row");
  ModelFile file;
  file.robot.name = name;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const bool slides = !types.empty() && types[k] == 'p';
    if (!types.empty() && !slides && types[k] != 'r') throw Error("types: one letter, r or p, for each row");
    file.robot.joints.push_back(make_joint("joint" + std::to_string(k + 1),
                                           slides ? JointType::prismatic : JointType::revolute,
                                           {rows[k][0], rows[k][1], rows[k][2], rows[k][3]}));
  }
  validate(file.robot);
  return PyRobot(file, name);
}

PyRobot with(const PyRobot& robot, const std::optional<Eigen::Vector3d>& gravity,
             const std::optional<Eigen::VectorXd>& parameters) {
  PyRobot changed = robot;
  if (gravity) changed.model.robot.gravity = *gravity;
  if (parameters) {
    changed.model.robot.set_parameters(*parameters);
    changed.model.coefficients.clear();
  }
  validate(changed.model.robot);
  return changed;
}

template <class Get>
Eigen::VectorXd over_joints(const PyRobot& robot, Get get) {
  Eigen::VectorXd x(robot.model.robot.size());
  for (Eigen::Index j = 0; j < x.size(); ++j)
    x[j] = get(robot.model.robot.joints[static_cast<std::size_t>(j)]);
  return x;
}

std::string info_text(const PyRobot& robot) {
  std::ostringstream out;
  print(out, run(InfoJob{robot.model.robot, false}));
  return out.str();
}

}  // namespace

void bind_robot(nb::module_& m) {
  nb::class_<PyRobot> robot(
      m, "Robot", "A serial arm: kinematics, inertias, friction, limits, servos. Never changed once made.");
  robot
      .def_static("from_file", &from_file, "path"_a, "base"_a = "", "tip"_a = "",
                  "allow_inconsistent"_a = true,
                  "Reads a URDF, an MJCF or a YAML model. `base`, `tip`: links, where it branches.")
      .def_static("from_text", &from_text, "text"_a, "name"_a = "text", "base"_a = "", "tip"_a = "",
                  "The same from a text; what an MJCF refers to is sought beside `name`.")
      .def_static(
          "from_mujoco", &from_mujoco, "model"_a, "base"_a = "", "tip"_a = "",
          "A compiled mujoco.MjModel: bodies, joints, armature, damping, frictionloss, position actuators.")
      .def_static(
          "from_dh", &from_dh, "rows"_a, "types"_a = "", "name"_a = "robot",
          "Rows (a [m], alpha [rad], d [m], theta [rad]) of modified Denavit-Hartenberg parameters, base to\n"
          "tip; `types`: r or p for each, all revolute when left out. Links have no inertia yet.")
      .def("replace", &with, nb::kw_only(), "gravity"_a = nb::none(), "parameters"_a = nb::none(),
           "A copy with another gravity [m/s^2] (base frame, shape (3,)) or standard parameters (shape (10 "
           "n,)).")
      .def_prop_ro("name", [](const PyRobot& r) { return r.model.robot.name; })
      .def_prop_ro("source", [](const PyRobot& r) { return r.source; })
      .def_prop_ro(
          "n", [](const PyRobot& r) { return r.model.robot.size(); }, "Number of joints.")
      .def_prop_ro("joint_names",
                   [](const PyRobot& r) {
                     std::vector<std::string> names;
                     for (const Joint& j : r.model.robot.joints) names.push_back(j.name);
                     return names;
                   })
      .def_prop_ro("link_names",
                   [](const PyRobot& r) {
                     std::vector<std::string> names;
                     for (const Joint& j : r.model.robot.joints) names.push_back(j.link_name);
                     return names;
                   })
      .def_prop_ro("base_link", [](const PyRobot& r) { return r.model.robot.base_link; })
      .def_prop_ro("tip_link", [](const PyRobot& r) { return r.model.robot.tip_link; })
      .def_prop_ro(
          "gravity", [](const PyRobot& r) { return r.model.robot.gravity; },
          "[m/s^2], in the base frame: (3,).")
      .def_prop_ro(
          "parameters", [](const PyRobot& r) { return r.model.robot.parameters(); },
          "Standard parameters (10 n,): m [kg], mx, my, mz [kg m], xx, xy, yy, xz, yz, zz [kg m^2] of each "
          "link,\n"
          "first moments and inertia about the origin of the link frame, in its axes.")
      .def_prop_ro(
          "rotor_inertia", [](const PyRobot& r) { return r.armature; }, "[kg m^2 or kg]: (n,).")
      .def_prop_ro(
          "viscous",
          [](const PyRobot& r) {
            return over_joints(r, [](const Joint& j) { return j.friction.linear.viscous; });
          },
          "Viscous friction [N m s/rad]: (n,).")
      .def_prop_ro(
          "coulomb",
          [](const PyRobot& r) {
            return over_joints(r, [](const Joint& j) { return j.friction.linear.coulomb; });
          },
          "Coulomb friction [N m]: (n,).")
      .def_prop_ro(
          "lower",
          [](const PyRobot& r) { return over_joints(r, [](const Joint& j) { return j.limits.lower; }); },
          "Position limits [rad or m]: (n,), infinite where unknown.")
      .def_prop_ro(
          "upper",
          [](const PyRobot& r) { return over_joints(r, [](const Joint& j) { return j.limits.upper; }); })
      .def_prop_ro(
          "torque_limit",
          [](const PyRobot& r) { return over_joints(r, [](const Joint& j) { return j.limits.torque; }); })
      .def_prop_ro(
          "kp",
          [](const PyRobot& r) {
            return over_joints(r, [](const Joint& j) { return j.servo ? j.servo->kp : 0.0; });
          },
          "Stiffness of the position servos [N m/rad]: (n,), 0 where there is none.")
      .def_prop_ro("kd",
                   [](const PyRobot& r) {
                     return over_joints(r, [](const Joint& j) { return j.servo ? j.servo->kd : 0.0; });
                   })
      .def_prop_ro(
          "not_expressed", [](const PyRobot& r) { return r.not_expressed; },
          "What of an MJCF this robot cannot say, one line each.")
      .def_prop_ro(
          "links",
          [](const PyRobot& r) {
            nb::list links;
            for (const Joint& j : r.model.robot.joints) {
              const LinkInertia link = from_standard(j.parameters);
              links.append(nb::make_tuple(link.mass, link.com, link.inertia));
            }
            return links;
          },
          "Of each link (mass [kg], centre of mass [m] (3,), inertia about it [kg m^2] (3, 3)), link frame.")
      .def(
          "to_yaml", [](const PyRobot& r) { return to_yaml(r.model); }, "The text of a model file.")
      .def(
          "write", [](const PyRobot& r, const std::string& path) { write_model(path, r.model); }, "path"_a,
          "Writes a model file (YAML), whole or not at all.")
      .def("info", &info_text, "Joints, limits, identifiable and base parameters, as text.")
      .def("__repr__", [](const PyRobot& r) {
        return "<dynid.Robot '" + r.model.robot.name + "', " + std::to_string(r.model.robot.size()) +
               " joints, " + r.model.robot.base_link + " to " + r.model.robot.tip_link + ">";
      });
  bind_kernels(robot);
  m.def(
      "has_mujoco", [] { return has_mjcf_compiler(); }, "libmujoco is part of this build.");
  m.def("use_mujoco", [](nb::callable compile) {
    // Held for ever: the interpreter is gone before what the library keeps is.
    const auto* kept = new nb::callable(std::move(compile));
    set_mjcf_compiler([kept](const std::string& text, const std::string& name) {
      const nb::gil_scoped_acquire acquire;
      try {
        return arrays_of((*kept)(text, name));
      } catch (nb::python_error& error) {
        throw Error(nb::cast<std::string>(nb::str(error.value())));
      }
    });
  });
}

}  // namespace dynid::python
