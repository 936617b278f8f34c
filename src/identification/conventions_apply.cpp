// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <string_view>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/identification/conventions.hpp"

namespace dynid {
namespace {

constexpr double pi = 3.14159265358979323846;
constexpr const char* keys =
    "torque_sign, joint_sign, joint_order, joint_zero, position_unit, velocity_unit, torque_unit, "
    "torque_is_motor_side, torque_is_current, torque_without_gravity, torque_is_magnitude, gravity, "
    "time_unit";

[[noreturn]] void refuse(const std::string& key, const std::string& what) {
  throw Error("--assume: " + key + ": " + what);
}

bool read_number(std::string_view text, double& value) {
  const char *first = text.data(), *last = first + text.size();
  if (first != last && *first == '+') ++first;
  const auto [end, code] = std::from_chars(first, last, value);
  return first != last && code == std::errc() && end == last && std::isfinite(value);
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',')
      parts.emplace_back();
    else if (c != ' ' && c != '\t')
      parts.back().push_back(c);
  }
  return parts;
}

/// As many numbers as `n`, or one for all where `common`.
Eigen::VectorXd numbers(const std::string& key, const std::vector<std::string>& values, int n, bool common) {
  if (static_cast<int>(values.size()) != n && !(common && values.size() == 1))
    refuse(key, std::to_string(values.size()) + " values given, " + std::to_string(n) + " needed" +
                    (common && n > 1 ? " (or one for all)" : ""));
  Eigen::VectorXd out(n);
  for (int j = 0; j < n; ++j) {
    const std::string& text = values[values.size() == 1 ? 0 : static_cast<std::size_t>(j)];
    if (!read_number(text, out[j])) refuse(key, "'" + text + "' is not a number");
  }
  return out;
}

Eigen::VectorXd signs(const std::string& key, const std::vector<std::string>& values, int n) {
  Eigen::VectorXd out = numbers(key, values, n, true);
  if (!(out.cwiseAbs().array() == 1.0).all()) refuse(key, "a sign is 1 or -1");
  return out;
}

double unit(const std::string& key, const std::vector<std::string>& values,
            const std::map<std::string, double>& known) {
  if (values.size() != 1) refuse(key, "one value is needed");
  const auto it = known.find(values[0]);
  if (it != known.end()) return it->second;
  double factor = 0.0;
  if (read_number(values[0], factor) && factor != 0.0) return factor;
  std::string names;
  for (const auto& entry : known) names += (names.empty() ? "" : ", ") + entry.first;
  refuse(key, "unknown unit '" + values[0] + "' (known: " + names + ", or a factor)");
}

bool yes(const std::string& key, const std::vector<std::string>& values) {
  if (values.size() == 1 && (values[0] == "1" || values[0] == "true" || values[0] == "yes")) return true;
  if (values.size() == 1 && (values[0] == "0" || values[0] == "false" || values[0] == "no")) return false;
  refuse(key, "1 or 0 is needed");
}

/// Columns of `x` in the order of the joints.
void reorder(Eigen::MatrixXd& x, const std::vector<int>& order) {
  if (x.size() > 0) x = Eigen::MatrixXd(x(Eigen::all, order));
}

void turn(Eigen::MatrixXd& x, const Eigen::VectorXd& sign) {
  if (x.size() > 0) x = x * sign.asDiagonal();
}

/// Nominal torque, friction included, along the log; accelerations by differences over some ten samples.
Eigen::MatrixXd nominal_torque(const Robot& robot, const Log& log) {
  const int n = robot.size();
  const Eigen::Index N = log.samples(), reach = std::max<Eigen::Index>(1, std::min<Eigen::Index>(10, N / 8));
  const Model<> model(robot);
  Workspace<> ws(model);
  Eigen::MatrixXd out(N, n);
  Eigen::VectorXd q(n), dq = Eigen::VectorXd::Zero(n), ddq = Eigen::VectorXd::Zero(n), tau(n);
  for (Eigen::Index i = 0; i < N; ++i) {
    const Eigen::Index a = std::max<Eigen::Index>(0, i - reach), b = std::min(N - 1, i + reach);
    const double span = log.t.size() == N ? log.t[b] - log.t[a] : 0.0;
    q = log.q.row(i).transpose();
    if (log.dq.size() > 0)
      dq = log.dq.row(i).transpose();
    else if (span > 0.0)
      dq = (log.q.row(b) - log.q.row(a)).transpose() / span;
    if (log.ddq.size() > 0)
      ddq = log.ddq.row(i).transpose();
    else if (log.dq.size() > 0 && span > 0.0)
      ddq = (log.dq.row(b) - log.dq.row(a)).transpose() / span;
    inverse_dynamics(model, ws, q, dq, ddq, tau);
    for (int j = 0; j < n; ++j) {
      const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
      out(i, j) = tau[j] + joint.rotor_inertia * ddq[j] + friction_torque(joint.friction, dq[j]);
    }
  }
  return out;
}

}  // namespace

bool Assumptions::empty() const {
  return order.empty() && joint_sign.size() == 0 && torque_sign.size() == 0 && zero.size() == 0 &&
         position_unit == 1.0 && velocity_unit == 1.0 && !velocity_from_position && time_unit == 1.0 &&
         torque_factor.size() == 0 && !without_gravity && !magnitude && !gravity;
}

Assumptions parse_assumptions(const std::string& text, int n) {
  std::vector<std::pair<std::string, std::vector<std::string>>> entries;
  for (const std::string& part : split(text)) {
    const auto equals = part.find('=');
    if (equals != std::string::npos) {
      entries.push_back({part.substr(0, equals), {part.substr(equals + 1)}});
    } else if (part.empty() && entries.empty()) {
      continue;
    } else if (entries.empty()) {
      throw Error("--assume: '" + part + "': KEY=VALUE,... is expected (keys: " + keys + ")");
    } else {
      entries.back().second.push_back(part);
    }
  }
  Assumptions a;
  std::map<std::string, bool> seen;
  bool factor_given = false;
  for (const auto& entry : entries) {
    const auto& key = entry.first;
    const auto& values = entry.second;
    if (seen[key]) refuse(key, "given twice");
    seen[key] = true;
    const auto factor = [&](const Eigen::VectorXd& f) {
      if (factor_given) refuse(key, "another factor of the torque is given already");
      if (!(f.array() != 0.0).all()) refuse(key, "a factor of zero leaves no torque");
      factor_given = true;
      a.torque_factor = f;
    };
    if (key == "torque_sign") {
      a.torque_sign = signs(key, values, n);
    } else if (key == "joint_sign") {
      a.joint_sign = signs(key, values, n);
    } else if (key == "joint_zero") {
      a.zero = numbers(key, values, n, false);
    } else if (key == "joint_order") {
      const Eigen::VectorXd order = numbers(key, values, n, false);
      std::vector<bool> used(static_cast<std::size_t>(n), false);
      for (const double x : order) {
        if (!(x >= 1.0 && x <= n) || x != std::floor(x) || used[static_cast<std::size_t>(x - 1.0)])
          refuse(key, "each of 1 to " + std::to_string(n) + " is needed once");
        used[static_cast<std::size_t>(x - 1.0)] = true;
        a.order.push_back(static_cast<int>(x) - 1);
      }
    } else if (key == "position_unit") {
      a.position_unit = unit(key, values, {{"deg", pi / 180.0}, {"turn", 2.0 * pi}, {"rad", 1.0}});
    } else if (key == "velocity_unit") {
      if (values.size() == 1 && values[0] == "from_position")
        a.velocity_from_position = true;
      else
        a.velocity_unit =
            unit(key, values,
                 {{"deg/s", pi / 180.0}, {"rpm", 2.0 * pi / 60.0}, {"turn/s", 2.0 * pi}, {"rad/s", 1.0}});
    } else if (key == "time_unit") {
      a.time_unit = unit(key, values, {{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}});
      if (!(a.time_unit > 0.0)) refuse(key, "time does not run backwards");
    } else if (key == "torque_unit") {
      factor(Eigen::VectorXd::Constant(n, unit(key, values,
                                               {{"Nmm", 1e-3},
                                                {"Ncm", 1e-2},
                                                {"Nm", 1.0},
                                                {"kgfcm", 0.0980665},
                                                {"kgfm", 9.80665},
                                                {"lbfin", 0.1129848}})));
    } else if (key == "torque_is_motor_side" || key == "torque_is_current") {
      factor(numbers(key, values, n, true));
    } else if (key == "torque_without_gravity") {
      a.without_gravity = yes(key, values);
    } else if (key == "torque_is_magnitude") {
      a.magnitude = yes(key, values);
    } else if (key == "gravity") {
      a.gravity = Eigen::Vector3d(numbers(key, values, 3, false));
    } else {
      refuse(key, std::string("unknown (known: ") + keys + ")");
    }
  }
  return a;
}

Robot apply_conventions(const Assumptions& a, Robot robot) {
  if (a.gravity) robot.gravity = *a.gravity;
  return robot;
}

Log apply_conventions(const Assumptions& a, const Robot& nominal, Log log) {
  const int n = nominal.size();
  if (log.joints() != n)
    throw Error(log.source + ": the log has " + std::to_string(log.joints()) + " joints, the robot has " +
                std::to_string(n));
  Eigen::MatrixXd* const positions[] = {&log.q, &log.theta, &log.u};
  Eigen::MatrixXd* const torques[] = {&log.tau, &log.tau_cmd};
  Eigen::MatrixXd* const all[] = {&log.q,       &log.dq,    &log.ddq, &log.tau, &log.u,
                                  &log.tau_cmd, &log.theta, &log.i,   &log.temp};
  Eigen::MatrixXd* const signed_ones[] = {&log.q, &log.dq,      &log.ddq,   &log.tau,
                                          &log.u, &log.tau_cmd, &log.theta, &log.i};
  if (a.time_unit != 1.0) log.t *= a.time_unit;
  if (!a.order.empty())
    for (Eigen::MatrixXd* x : all) reorder(*x, a.order);
  for (int j = 0; j < n; ++j) {
    if (nominal.joints[static_cast<std::size_t>(j)].type == JointType::prismatic) continue;
    for (Eigen::MatrixXd* x : positions)
      if (x->size() > 0 && a.position_unit != 1.0) x->col(j) *= a.position_unit;
  }
  for (Eigen::MatrixXd* x : {&log.dq, &log.ddq})
    if (x->size() > 0 && a.velocity_unit != 1.0) *x *= a.velocity_unit;
  if (a.velocity_from_position) log.dq.resize(0, 0), log.ddq.resize(0, 0);
  if (a.joint_sign.size() == n)
    for (Eigen::MatrixXd* x : signed_ones) turn(*x, a.joint_sign);
  if (a.zero.size() == n)
    for (Eigen::MatrixXd* x : positions)
      if (x->size() > 0) x->rowwise() += a.zero.transpose();
  for (Eigen::MatrixXd* x : torques) {
    if (a.torque_factor.size() == n) turn(*x, a.torque_factor);
    if (a.torque_sign.size() == n) turn(*x, a.torque_sign);
  }
  if (a.magnitude && log.tau.size() > 0) {
    const Eigen::MatrixXd model = nominal_torque(nominal, log);
    log.tau = (model.array() >= 0.0).select(log.tau.cwiseAbs(), -log.tau.cwiseAbs());
  }
  if (a.without_gravity && log.tau.size() > 0) {
    const Model<> model(nominal);
    Workspace<> ws(model);
    Eigen::VectorXd q(n), g(n);
    for (Eigen::Index i = 0; i < log.samples(); ++i) {
      q = log.q.row(i).transpose();
      gravity(model, ws, q, g);
      log.tau.row(i) += g.transpose();
    }
  }
  return log;
}

}  // namespace dynid
