// SPDX-License-Identifier: Apache-2.0
#include "ros/plant_command.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"

namespace dynid {
namespace {

using Eigen::Index;
using Point = trajectory_msgs::JointTrajectoryPoint;
using Values = std::vector<double>;

constexpr double standing = 0.05;  // [rad/s] that a controller takes in its stride

std::string number(double x) { return short_number(x, 4); }
std::string quoted(const std::string& name) { return "joint '" + name + "'"; }

/// Column in the message of each joint of the robot.
std::vector<std::size_t> columns(const std::vector<std::string>& names, const Robot& robot) {
  std::vector<std::size_t> column;
  for (const Joint& joint : robot.joints) {
    const auto found = std::find(names.begin(), names.end(), joint.name);
    if (found == names.end()) throw Error(quoted(joint.name) + " is missing");
    if (std::find(found + 1, names.end(), joint.name) != names.end())
      throw Error(quoted(joint.name) + " is named twice");
    column.push_back(static_cast<std::size_t>(found - names.begin()));
  }
  for (const std::string& name : names)
    if (std::none_of(robot.joints.begin(), robot.joints.end(),
                     [&](const Joint& joint) { return joint.name == name; }))
      throw Error(quoted(name) + " is not one of the robot's");
  return column;
}

/// Slopes of the parabolas through neighbouring points; zero at the ends.
Eigen::MatrixXd slopes(const Eigen::VectorXd& t, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd dx = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (Index i = 1; i + 1 < x.rows(); ++i) {
    const double before = t[i] - t[i - 1], after = t[i + 1] - t[i];
    dx.row(i) = (after / before * (x.row(i) - x.row(i - 1)) + before / after * (x.row(i + 1) - x.row(i))) /
                (before + after);
  }
  return dx;
}

void check_within(const std::string& joint, const char* what, double value, double least, double most,
                  double slack, double t) {
  if (value >= least - slack && value <= most + slack) return;
  throw Error(quoted(joint) + ": " + what + " " + number(value) + " at " + number(t) + " s is beyond " +
              number(value < least ? least : most));
}

void check_limits(const Trajectory& motion, const Robot& robot) {
  const Index n = robot.size();
  Eigen::VectorXd q(n), dq(n), ddq(n);
  const double end = motion.t[motion.samples() - 1];
  const auto steps = static_cast<long>(std::ceil(1000.0 * end));
  constexpr double room = 0.01;  // what numbers with a few decimals do to the derivatives
  for (long k = 0; k <= steps; ++k) {
    const double t = std::min(end, 1e-3 * double(k));
    sample(motion, t, q, dq, ddq);
    for (Index j = 0; j < n; ++j) {
      const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
      const JointLimits& limits = joint.limits;
      const double v = limits.velocity, a = limits.acceleration;
      check_within(joint.name, "position", q[j], limits.lower, limits.upper, 1e-6, t);
      check_within(joint.name, "velocity", dq[j], -v, v, room * v, t);
      check_within(joint.name, "acceleration", ddq[j], -a, a, room * a, t);
    }
  }
}

}  // namespace

Trajectory motion_from(const trajectory_msgs::JointTrajectory& command, const Robot& robot,
                       const Eigen::VectorXd& held, double tolerance) {
  const auto& points = command.points;
  if (points.empty()) throw Error("there are no points");
  const std::vector<std::size_t> column = columns(command.joint_names, robot);
  const Index n = robot.size(), first = points.front().time_from_start > ros::Duration(0) ? 1 : 0,
              rows = static_cast<Index>(points.size()) + first;
  Trajectory motion;
  motion.source = "command";
  motion.t.setZero(rows);
  motion.q.setZero(rows, n);
  motion.q.row(0) = held;
  motion.dq.setZero(rows, n);
  motion.ddq.setZero(rows, n);

  // Fills one of the matrices; false where the message leaves it out.
  const auto fill = [&](const char* what, Values Point::*of, Eigen::MatrixXd& into) {
    if ((points.front().*of).empty()) {
      for (const Point& point : points)
        if (!(point.*of).empty())
          throw Error(std::string("some points have ") + what + " and others have none");
      return false;
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Values& values = points[i].*of;
      const std::string where = "point " + std::to_string(i + 1) + ": ";
      if (values.size() != command.joint_names.size())
        throw Error(where + std::to_string(values.size()) + " " + what + " for " +
                    std::to_string(command.joint_names.size()) + " joints");
      for (Index j = 0; j < n; ++j) {
        const double x = values[column[static_cast<std::size_t>(j)]];
        if (!std::isfinite(x))
          throw Error(where + what + " of " + quoted(robot.joints[static_cast<std::size_t>(j)].name) +
                      " are not finite");
        into(static_cast<Index>(i) + first, j) = x;
      }
    }
    return true;
  };
  if (!fill("positions", &Point::positions, motion.q)) throw Error("the points have no positions");
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Index row = static_cast<Index>(i) + first;
    motion.t[row] = points[i].time_from_start.toSec();
    if (motion.t[row] < 0.0 || (row > 0 && !(motion.t[row] > motion.t[row - 1])))
      throw Error("point " + std::to_string(i + 1) + ": time_from_start does not increase");
  }
  if (!fill("velocities", &Point::velocities, motion.dq)) motion.dq = slopes(motion.t, motion.q);
  if (!fill("accelerations", &Point::accelerations, motion.ddq)) motion.ddq = slopes(motion.t, motion.dq);

  for (Index j = 0; j < n; ++j) {
    const std::string& name = robot.joints[static_cast<std::size_t>(j)].name;
    if (!(std::abs(motion.q(0, j) - held[j]) <= tolerance))
      throw Error(quoted(name) + ": the motion starts at " + number(motion.q(0, j)) + ", the arm is at " +
                  number(held[j]));
    if (std::abs(motion.dq(0, j)) > standing)
      throw Error(quoted(name) + ": the motion does not start at rest");
    if (std::abs(motion.dq(rows - 1, j)) > standing)
      throw Error(quoted(name) + ": the motion does not end at rest");
  }
  check_limits(motion, robot);
  return motion;
}

}  // namespace dynid
