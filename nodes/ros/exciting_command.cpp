// SPDX-License-Identifier: Apache-2.0
#include "ros/exciting_command.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "dynid/base/error.hpp"

namespace dynid {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double rest = 0.05;     // [rad/s]
constexpr double dwell = 0.5;     // [s] before the motion begins
constexpr double spacing = 0.01;  // [s] of the approach

[[noreturn]] void refuse(const Robot& robot, Index joint, const std::string& what, double value,
                         const std::string& than) {
  std::ostringstream text;
  text << "joint '" << robot.joints[static_cast<std::size_t>(joint)].name << "': " << what << " " << value
       << than;
  throw Error(text.str());
}

void check(const Robot& robot, const VectorXd& q, const Trajectory& motion) {
  if (motion.joints() != robot.size() || q.size() != robot.size())
    throw Error(motion.source + ": " + std::to_string(motion.joints()) + " joints, the robot has " +
                std::to_string(robot.size()));
  for (Index j = 0; j < robot.size(); ++j) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    if (q[j] < limits.lower || q[j] > limits.upper)
      refuse(robot, j, "the arm is at", q[j], ", beyond the position limits");
    for (const double x : {motion.q.col(j).minCoeff(), motion.q.col(j).maxCoeff()})
      if (x < limits.lower || x > limits.upper)
        refuse(robot, j, "the motion goes to", x, ", beyond the position limits");
    const double fastest = motion.dq.col(j).cwiseAbs().maxCoeff();
    if (fastest > limits.velocity * (1.0 + 1e-9))
      refuse(robot, j, "the motion is as fast as", fastest, ", beyond the velocity limit");
    for (const Index end : {Index(0), motion.samples() - 1})
      if (std::abs(motion.dq(end, j)) > rest)
        refuse(robot, j, "the motion starts or ends at a velocity of", motion.dq(end, j), ", not at rest");
  }
}

}  // namespace

Trajectory with_approach(const Robot& robot, const VectorXd& q, const Trajectory& motion, double share) {
  check(robot, q, motion);
  const VectorXd way = motion.q.row(0).transpose() - q;
  double duration = 0.5;  // [s], at least
  for (Index j = 0; j < robot.size(); ++j) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    const double velocity = share * (std::isfinite(limits.velocity) ? limits.velocity : 1.0);
    const double acceleration = share * (std::isfinite(limits.acceleration) ? limits.acceleration : 5.0);
    // Largest velocity 15/8 and acceleration 10/sqrt(3) of 10 u^3 - 15 u^4 + 6 u^5.
    duration = std::max({duration, 1.875 * std::abs(way[j]) / velocity,
                         std::sqrt(10.0 / std::sqrt(3.0) * std::abs(way[j]) / acceleration)});
  }
  const auto steps = static_cast<Index>(std::ceil(duration / spacing));
  duration = double(steps) * spacing;
  Trajectory all;
  all.source = motion.source;
  const Index rows = steps + 1 + motion.samples(), n = robot.size();
  all.t.resize(rows);
  for (Eigen::MatrixXd* x : {&all.q, &all.dq, &all.ddq}) x->resize(rows, n);
  for (Index i = 0; i <= steps; ++i) {
    const double u = double(i) / double(steps), T = duration;
    all.t[i] = u * T;
    all.q.row(i) = q.transpose() + u * u * u * (10.0 + u * (-15.0 + 6.0 * u)) * way.transpose();
    all.dq.row(i) = 30.0 * u * u * (1.0 + u * (-2.0 + u)) / T * way.transpose();
    all.ddq.row(i) = 60.0 * u * (1.0 + u * (-3.0 + 2.0 * u)) / (T * T) * way.transpose();
  }
  all.t.tail(motion.samples()) = motion.t.array() - motion.t[0] + duration + dwell;
  all.q.bottomRows(motion.samples()) = motion.q;
  all.dq.bottomRows(motion.samples()) = motion.dq;
  all.ddq.bottomRows(motion.samples()) = motion.ddq;
  return all;
}

trajectory_msgs::JointTrajectory to_message(const Trajectory& motion, const Robot& robot) {
  trajectory_msgs::JointTrajectory message;
  for (const Joint& joint : robot.joints) message.joint_names.push_back(joint.name);
  message.points.resize(static_cast<std::size_t>(motion.samples()));
  const auto row = [](const Eigen::MatrixXd& x, Index i) {
    const VectorXd values = x.row(i);
    return std::vector<double>(values.begin(), values.end());
  };
  for (Index i = 0; i < motion.samples(); ++i) {
    trajectory_msgs::JointTrajectoryPoint& point = message.points[static_cast<std::size_t>(i)];
    point.positions = row(motion.q, i);
    point.velocities = row(motion.dq, i);
    point.accelerations = row(motion.ddq, i);
    point.time_from_start.fromNSec(std::llround(1e9 * motion.t[i]));
  }
  return message;
}

double tracking_error(const Trajectory& motion, double t, const VectorXd& q, int& joint) {
  VectorXd wanted(q.size()), dq(q.size()), ddq(q.size());
  double least = std::numeric_limits<double>::infinity();
  for (int step = 0; step <= 20; ++step) {
    sample(motion, t - 0.05 * step, wanted, dq, ddq);
    Index at = 0;
    const double error = (q - wanted).cwiseAbs().maxCoeff(&at);
    if (error >= least) continue;
    least = error;
    joint = static_cast<int>(at) + 1;
  }
  return least;
}

}  // namespace dynid
