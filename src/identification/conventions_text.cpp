// SPDX-License-Identifier: Apache-2.0
// How a reading is said, to a person and to parse_assumptions().
#include <cmath>
#include <cstdio>

#include "conventions_search.hpp"

namespace dynid::detail {

using Eigen::Index;

namespace {

/// [N m per unit]: from here a gear ratio, below it a torque constant.
constexpr double gear_not_constant = 30.0;

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.7g", x == 0.0 ? 0.0 : x);
  return text;
}

std::string list(const Eigen::VectorXd& x, int digits = 7) {
  std::string text;
  char one[32];
  for (Index j = 0; j < x.size(); ++j) {
    std::snprintf(one, sizeof one, "%.*g", digits, x[j] == 0.0 ? 0.0 : x[j]);
    text += (j > 0 ? "," : "") + std::string(one);
  }
  return text;
}

std::string joints_text(const std::vector<int>& joints) {
  std::string text;
  for (std::size_t i = 0; i < joints.size(); ++i)
    text += (i == 0 ? "" : i + 1 == joints.size() ? " and " : ", ") + std::to_string(joints[i]);
  return text;
}

bool near_factor(double a, double b) { return std::abs(std::log(a / b)) < 0.25; }

}  // namespace

std::vector<Convention> conventions_of(const Reading& r, const Robot& robot, const VelocityReading& k,
                                       const std::vector<bool>& felt) {
  const int n = robot.size();
  std::vector<Convention> out;
  const auto add = [&](const char* name, std::vector<int> joints, double value, const std::string& assume,
                       const std::string& text) {
    out.push_back({name, std::move(joints), value, 0.0, 0.0, std::string(name) + "=" + assume, text});
  };
  if (r.time_unit != 1.0) {
    const char* unit = r.time_unit < 1e-8 ? "ns" : r.time_unit < 1e-5 ? "us" : "ms";
    add("time_unit", {}, r.time_unit, unit, std::string("stamps are in ") + unit);
  }
  std::vector<int> moved;
  std::string order;
  for (int j = 0; j < n; ++j) {
    if (r.order[j] != j) moved.push_back(j + 1);
    order += (j > 0 ? "," : "") + std::to_string(r.order[j] + 1);
  }
  if (!moved.empty())
    add("joint_order", moved, double(moved.size()), order,
        "the log's joints stand in another order: base to tip they are its " + order);
  if (r.position_unit != 1.0) add("position_unit", {}, r.position_unit, "deg", "positions are in degrees");
  if (k.unrelated) {
    add("velocity_unit", {}, 0.0, "from_position", "the velocities are not those of the positions");
  } else {
    // Against positions and stamps as they are now read.
    const double unit = k.velocity_unit * r.position_unit * (k.time_unit / r.time_unit);
    if (near_factor(unit, degree_of_angle))
      add("velocity_unit", {}, degree_of_angle, "deg/s", "velocities are in degrees a second");
    else if (near_factor(unit, 2.0 * (180.0 * degree_of_angle) / 60.0))
      add("velocity_unit", {}, 2.0 * (180.0 * degree_of_angle) / 60.0, "rpm",
          "velocities are in turns a minute");
    else if (!(unit > 0.0))
      add("velocity_unit", {}, unit, number(unit), "velocities have the other sign");
    else if (!near_factor(unit, 1.0))
      add("velocity_unit", {}, unit, number(unit),
          "velocities are " + number(1.0 / unit) + " times those of the positions");
  }
  std::vector<int> joints;
  for (int j = 0; j < n; ++j)
    if (r.sign[j] < 0.0) joints.push_back(j + 1);
  if (!joints.empty())
    add("joint_sign", joints, -1.0, list(r.sign), "joint " + joints_text(joints) + " counts the other way");
  joints.clear();
  for (int j = 0; j < n; ++j)
    if (r.zero[j] != 0.0) joints.push_back(j + 1);
  if (!joints.empty())
    add("joint_zero", joints, r.zero[joints.front() - 1], list(r.zero, 10),
        "the zero of joint " + joints_text(joints) + " lies elsewhere");
  joints.clear();
  const Eigen::VectorXd torque_sign = r.torque_sign.cwiseProduct(r.sign);
  for (int j = 0; j < n; ++j)
    if (torque_sign[j] < 0.0) joints.push_back(j + 1);
  if (!joints.empty())
    add("torque_sign", joints, -1.0, static_cast<int>(joints.size()) == n ? "-1" : list(torque_sign),
        "the torque of joint " + joints_text(joints) + " has the other sign");
  if (!r.factor.isOnes(0.0)) {
    const double f = r.factor[0];
    std::vector<double> sorted(r.factor.begin(), r.factor.end());
    std::sort(sorted.begin(), sorted.end());
    const double median = sorted[sorted.size() / 2];
    if (r.unit_of_torque) {
      std::string unit;
      for (const TorqueUnit& u : torque_units)
        if (u.factor == f) unit = u.name;
      add("torque_unit", {}, f, unit == "kNm" ? "1000" : unit,
          unit == "kNm" ? "torques are a thousandth of the model's (or the model's masses are in grams)"
                        : "torques are in " + unit);
    } else {
      const bool one = (r.factor.array() == f).all();
      const bool gear = median >= gear_not_constant;
      std::vector<int> told, others;
      for (std::size_t j = 0; j < felt.size(); ++j)
        (felt[j] ? told : others).push_back(static_cast<int>(j) + 1);
      std::string text = gear ? "torques are on the motor's side of the gears" : "torques are motor currents";
      if (!told.empty() && !others.empty())
        text += " (joint " + joints_text(others) + " hardly feels the arm: the factor there is the others')";
      add(gear ? "torque_is_motor_side" : "torque_is_current", others.empty() ? std::vector<int>{} : told,
          median, one ? number(f) : list(r.factor, 5), text);
    }
  }
  if (r.magnitude)
    add("torque_is_magnitude", {}, 1.0, "1", "torques have lost their sign: the log has their magnitude");
  if (r.without_gravity)
    add("torque_without_gravity", {}, 1.0, "1",
        "torques are without gravity: the controller has taken it off");
  if (r.turned_gravity) {
    const double cosine =
        r.gravity.dot(robot.gravity) / (r.gravity.norm() * std::max(robot.gravity.norm(), 1e-12));
    add("gravity", {}, std::acos(std::clamp(cosine, -1.0, 1.0)), list(r.gravity, 5),
        "the arm is mounted otherwise: gravity in its base frame is (" + list(r.gravity, 4) + ") m/s^2");
  }
  return out;
}

std::string joined(const std::vector<Convention>& conventions) {
  std::string text;
  for (const Convention& c : conventions) text += (text.empty() ? "" : ",") + c.assume;
  return text;
}

}  // namespace dynid::detail
