// SPDX-License-Identifier: Apache-2.0
#include "dynid/dynamics/joint_scale.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"

namespace dynid {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int poses = 512;
constexpr Eigen::Index most_rows = 2048;
constexpr double least_part = 1e-6;        // of the arm's largest: a joint that carries nothing
constexpr double part_at_rest = 1e-3;      // of the model-based scale: a joint that does not move
constexpr double earth_gravity = 9.80665;  // [m/s^2] where the model has none

const JointUnits revolute_units = {"rad",     "rad/s",     "rad/s^2", "N m",   "N m/s",
                                   "N m/rad", "N m s/rad", "kg m^2",  "1/rad", "s/rad"};
const JointUnits prismatic_units = {"m", "m/s", "m/s^2", "N", "N/s", "N/m", "N s/m", "kg", "1/m", "s/m"};

constexpr std::string JointUnits::*every_unit[] = {
    &JointUnits::position,     &JointUnits::velocity,    &JointUnits::acceleration, &JointUnits::torque,
    &JointUnits::torque_rate,  &JointUnits::stiffness,   &JointUnits::damping,      &JointUnits::inertia,
    &JointUnits::per_position, &JointUnits::per_velocity};

}  // namespace

double arm_reach(const Robot& robot) {
  double reach = 0.0;
  for (std::size_t i = 1; i < robot.joints.size(); ++i) reach += robot.joints[i].origin.translation().norm();
  const StandardParameters& last = robot.joints.back().parameters;
  const double com = last[0] > 0.0 ? last.segment<3>(1).norm() / last[0] : 0.0;
  reach += std::max(com, robot.tip.translation().norm());
  if (reach > 0.0) return reach;
  // Bodies about one point: the largest radius of gyration, or the unit of length.
  for (const Joint& joint : robot.joints)
    if (joint.parameters[0] > 0.0)
      reach = std::max(
          reach, std::sqrt(std::max(0.0, joint.parameters.segment<3>(4).maxCoeff()) / joint.parameters[0]));
  return reach > 0.0 ? reach : 1.0;
}

namespace {

/// No joint is left with nothing: as much of the power (the one quantity that all types of joint share) as
/// makes it a millionth of the arm's largest.
void fill_up(std::vector<JointScale>& scales) {
  double power = 0.0;
  for (const JointScale& s : scales) power = std::max(power, s.torque * s.speed);
  if (!(power > 0.0)) power = 1.0;  // no mass at all: there is no scale to be had
  for (JointScale& s : scales) {
    const double least = least_part * power / s.speed;
    s.torque = std::max(s.torque, least);
    s.inertia = std::max(s.inertia, least / s.acceleration);
    s.gravity = std::max(s.gravity, least_part * s.torque);
  }
}

}  // namespace

const JointUnits& joint_units(JointType type) {
  return type == JointType::prismatic ? prismatic_units : revolute_units;
}

std::string unit_for(JointType type, const std::string& unit_on_revolute) {
  if (type == JointType::prismatic)
    for (const auto unit : every_unit)
      if (revolute_units.*unit == unit_on_revolute) return prismatic_units.*unit;
  return unit_on_revolute;
}

double JointScale::of(const std::string& unit) const {
  const auto is = [&unit](std::string JointUnits::*member) {
    return revolute_units.*member == unit || prismatic_units.*member == unit;
  };
  if (unit == "1" || unit == "deg") return 1.0;
  if (unit == "s") return duration();
  if (is(&JointUnits::position)) return travel;
  if (is(&JointUnits::velocity)) return speed;
  if (is(&JointUnits::acceleration)) return acceleration;
  if (is(&JointUnits::torque)) return torque;
  if (is(&JointUnits::torque_rate)) return torque / duration();
  if (is(&JointUnits::stiffness)) return stiffness();
  if (is(&JointUnits::damping)) return damping();
  if (is(&JointUnits::inertia)) return inertia;
  if (is(&JointUnits::per_position)) return 1.0 / travel;
  if (is(&JointUnits::per_velocity)) return 1.0 / speed;
  throw Error("unit '" + unit + "': not of a quantity of one joint");
}

std::vector<JointScale> joint_scales(const Robot& robot) {
  const Model<> model(robot);
  Workspace<> ws(model);
  const int n = robot.size();
  const double reach = arm_reach(robot);
  const double gravity_size = robot.gravity.norm() > 0.0 ? robot.gravity.norm() : earth_gravity;
  std::vector<JointScale> scales(static_cast<std::size_t>(n));
  VectorXd low(n), high(n), q(n), g(n);
  for (int j = 0; j < n; ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    const JointLimits& limits = joint.limits;
    JointScale& s = scales[static_cast<std::size_t>(j)];
    s.type = joint.type;
    const bool slides = joint.type == JointType::prismatic;
    const bool bounded = joint.type != JointType::continuous && std::isfinite(limits.lower) &&
                         std::isfinite(limits.upper) && limits.upper > limits.lower;
    const double whole = slides ? reach : 2.0 * M_PI;
    low[j] = bounded ? limits.lower : -0.5 * whole;
    high[j] = bounded ? limits.upper : 0.5 * whole;
    s.travel = high[j] - low[j];
    const double pendulum = std::sqrt(slides ? gravity_size * reach : gravity_size / reach);
    s.speed = std::isfinite(limits.velocity) && limits.velocity > 0.0 ? limits.velocity : pendulum;
    s.acceleration = 2.0 * s.speed * s.speed / s.travel;  // to the speed within a quarter of the travel
    if (limits.acceleration > 0.0) s.acceleration = std::min(s.acceleration, limits.acceleration);
  }
  std::mt19937_64 random(1);
  std::vector<std::vector<double>> inertia(static_cast<std::size_t>(n));
  VectorXd square = VectorXd::Zero(n), peak = VectorXd::Zero(n);
  MatrixXd M(n, n);
  for (int k = 0; k < poses; ++k) {
    for (int j = 0; j < n; ++j)
      q[j] = low[j] + (high[j] - low[j]) * (double(random() >> 11) * 0x1p-53);  // the same everywhere
    gravity(model, ws, q, g);
    mass_matrix(model, ws, q, M);
    square += g.cwiseAbs2() / double(poses);
    peak = peak.cwiseMax(g.cwiseAbs());
    for (int j = 0; j < n; ++j) inertia[static_cast<std::size_t>(j)].push_back(M(j, j));
  }
  for (int j = 0; j < n; ++j) {
    const auto i = static_cast<std::size_t>(j);
    JointScale& s = scales[i];
    s.inertia = std::max(0.0, median(inertia[i]) + robot.joints[i].rotor_inertia);
    s.torque = std::hypot(std::sqrt(square[j]), s.inertia * s.acceleration);
    s.gravity = peak[j];
  }
  fill_up(scales);
  return scales;
}

std::vector<JointScale> joint_scales(const Robot& robot, const MatrixXd& q, const MatrixXd& dq,
                                     const MatrixXd& ddq, const MatrixXd& tau, double period) {
  std::vector<JointScale> scales = joint_scales(robot);
  const int n = robot.size();
  for (const MatrixXd* m : {&q, &dq, &ddq, &tau}) {
    if (m == &tau && m->size() == 0) continue;
    if (m->cols() != n || m->rows() != q.rows() || q.rows() < 1)
      throw Error("joint scales: the motion must have as many columns as the robot has joints (" +
                  std::to_string(n) + "), and rows, the same for q, dq, ddq and tau");
    if (!m->allFinite()) throw Error("joint scales: the motion has a value that is not finite");
  }
  if (!(period >= 0.0) || !std::isfinite(period))
    throw Error("joint scales: the sampling period must not be negative");
  const Model<> model(robot);
  Workspace<> ws(model);
  const Eigen::Index rows = std::min(q.rows(), most_rows);
  std::vector<std::vector<double>> inertia(static_cast<std::size_t>(n));
  VectorXd x(n), v(n), a(n), torque(n), g(n), square = VectorXd::Zero(n), peak = VectorXd::Zero(n);
  VectorXd measured = VectorXd::Zero(n);
  MatrixXd M(n, n);
  for (Eigen::Index k = 0; k < rows; ++k) {
    const Eigen::Index i = k * q.rows() / rows;
    x = q.row(i), v = dq.row(i), a = ddq.row(i);
    inverse_dynamics(model, ws, x, v, a, torque);
    gravity(model, ws, x, g);
    mass_matrix(model, ws, x, M);
    for (int j = 0; j < n; ++j) torque[j] += robot.joints[static_cast<std::size_t>(j)].rotor_inertia * a[j];
    square += torque.cwiseAbs2() / double(rows);
    if (tau.size() > 0) measured += tau.row(i).transpose().cwiseAbs2() / double(rows);
    peak = peak.cwiseMax(g.cwiseAbs());
    for (int j = 0; j < n; ++j) inertia[static_cast<std::size_t>(j)].push_back(M(j, j));
  }
  const VectorXd speed = dq.cwiseAbs().colwise().maxCoeff();
  const VectorXd travel = (q.colwise().maxCoeff() - q.colwise().minCoeff()).transpose();
  const VectorXd acceleration = (ddq.colwise().squaredNorm() / double(ddq.rows())).cwiseSqrt();
  for (int j = 0; j < n; ++j) {
    const auto i = static_cast<std::size_t>(j);
    JointScale& s = scales[i];
    const double of_model = s.torque;
    s.speed = std::max(speed[j], part_at_rest * s.speed);
    s.travel = std::max(travel[j], part_at_rest * s.travel);
    s.acceleration = std::max(acceleration[j], part_at_rest * s.acceleration);
    s.inertia = std::max(0.0, median(inertia[i]) + robot.joints[i].rotor_inertia);
    s.gravity = peak[j];
    s.torque = std::sqrt(square[j]);
    if (s.torque <= least_part * of_model) s.torque = std::sqrt(measured[j]);
    if (s.torque <= least_part * of_model) s.torque = part_at_rest * of_model;
    s.sampling = period;
    s.recorded = period * double(q.rows());
  }
  fill_up(scales);
  return scales;
}

}  // namespace dynid
