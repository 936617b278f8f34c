// SPDX-License-Identifier: Apache-2.0
#include "dynid/signal/trajectory.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {
namespace {

/// Derivative of each column at any spacing: the slope, at the sample, of the parabola through it and its
/// neighbours (through the first or last three samples at the ends).
Eigen::MatrixXd derivative(const Eigen::VectorXd& t, const Eigen::MatrixXd& x) {
  const Eigen::Index samples = t.size();
  Eigen::MatrixXd dx(x.rows(), x.cols());
  for (Eigen::Index i = 0; i < samples; ++i) {
    const Eigen::Index k = std::clamp<Eigen::Index>(i, 1, samples - 2);
    const double h0 = t[k] - t[k - 1], h1 = t[k + 1] - t[k], s = t[i] - t[k];
    const double curvature = 1.0 / (h0 + h1);
    dx.row(i) = (h1 * (x.row(k) - x.row(k - 1)) / h0 + h0 * (x.row(k + 1) - x.row(k)) / h1) * curvature +
                2.0 * s * curvature * ((x.row(k + 1) - x.row(k)) / h1 - (x.row(k) - x.row(k - 1)) / h0);
  }
  return dx;
}

void check_sizes(const Trajectory& trajectory, const std::string& name) {
  const auto fits = [&](const Eigen::MatrixXd& x) {
    return x.rows() == trajectory.t.size() && x.cols() == trajectory.q.cols();
  };
  if (!fits(trajectory.q) || !fits(trajectory.dq) || !fits(trajectory.ddq))
    throw Error(name + ": t, q, dq and ddq of the trajectory have different sizes");
}

/// Decimals without an exponent: YAML 1.1 takes 1e-05 for text.
std::string decimals(double x) { return fixed_number(x, 9); }

void emit_row(YAML::Emitter& out, const char* key, const Eigen::MatrixXd& x, Eigen::Index row) {
  out << YAML::Key << key << YAML::Value << YAML::Flow << YAML::BeginSeq;
  for (Eigen::Index j = 0; j < x.cols(); ++j) out << decimals(x(row, j));
  out << YAML::EndSeq;
}

void emit_time(YAML::Emitter& out, const char* key, double seconds) {
  const auto nanoseconds = static_cast<long long>(std::llround(1e9 * seconds));
  out << YAML::Key << key << YAML::Value << YAML::Flow << YAML::BeginMap;
  out << YAML::Key << "secs" << YAML::Value << nanoseconds / 1000000000;
  out << YAML::Key << "nsecs" << YAML::Value << nanoseconds % 1000000000;
  out << YAML::EndMap;
}

}  // namespace

Trajectory read_trajectory(const std::string& path, int joints) {
  const Table table = read_table(path);
  const int found = table.count("q");
  const int n = joints > 0 ? joints : found;
  if (n < 1) throw Error(path + ": column q1 is missing");
  if (found > n)
    throw Error(path + ": column q" + std::to_string(found) + ": the robot has " + std::to_string(n) +
                " joints");
  const int time = table.find("t");
  if (time < 0) throw Error(path + ": column t is missing");

  Trajectory trajectory;
  trajectory.source = path;
  trajectory.t = table.values.col(time);
  trajectory.q = table.group("q", n, true);
  trajectory.dq = table.group("dq", n, false);
  trajectory.ddq = table.group("ddq", n, false);
  const bool differentiated = trajectory.dq.size() == 0 || trajectory.ddq.size() == 0;
  const Eigen::Index samples = trajectory.samples(), needed = differentiated ? 3 : 2;
  if (samples < needed)
    throw Error(path + ": " + std::to_string(samples) + " samples: a trajectory has at least " +
                std::to_string(needed));
  for (Eigen::Index i = 1; i < samples; ++i)
    if (!(trajectory.t[i] > trajectory.t[i - 1]))
      throw Error(path + ":" + std::to_string(table.lines[static_cast<std::size_t>(i)]) +
                  ": column t: time does not increase");
  if (trajectory.dq.size() == 0) trajectory.dq = derivative(trajectory.t, trajectory.q);
  if (trajectory.ddq.size() == 0) trajectory.ddq = derivative(trajectory.t, trajectory.dq);
  return trajectory;
}

void write_trajectory(const std::string& path, const Trajectory& trajectory) {
  check_sizes(trajectory, path);
  std::vector<std::string> names = {"t"};
  for (const char* prefix : {"q", "dq", "ddq"})
    for (const std::string& name : column_names(prefix, trajectory.joints())) names.push_back(name);
  Eigen::MatrixXd values(trajectory.samples(), 1 + 3 * trajectory.joints());
  values << trajectory.t, trajectory.q, trajectory.dq, trajectory.ddq;
  write_table(path, names, values);
}

std::string to_joint_trajectory(const Trajectory& trajectory, const std::vector<std::string>& joint_names) {
  const std::string name = trajectory.source.empty() ? "trajectory" : trajectory.source;
  check_sizes(trajectory, name);
  if (static_cast<int>(joint_names.size()) != trajectory.joints())
    throw Error(name + ": " + std::to_string(joint_names.size()) + " joint names for " +
                std::to_string(trajectory.joints()) + " joints");
  YAML::Emitter out;
  out << YAML::BeginMap;
  out << YAML::Key << "header" << YAML::Value << YAML::BeginMap;
  emit_time(out, "stamp", 0.0);
  out << YAML::Key << "frame_id" << YAML::Value << YAML::DoubleQuoted << "";
  out << YAML::EndMap;
  out << YAML::Key << "joint_names" << YAML::Value << YAML::Flow << joint_names;
  out << YAML::Key << "points" << YAML::Value << YAML::BeginSeq;
  for (Eigen::Index i = 0; i < trajectory.samples(); ++i) {
    out << YAML::BeginMap;
    emit_row(out, "positions", trajectory.q, i);
    emit_row(out, "velocities", trajectory.dq, i);
    emit_row(out, "accelerations", trajectory.ddq, i);
    emit_time(out, "time_from_start", trajectory.t[i] - trajectory.t[0]);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap << YAML::Newline;
  return out.c_str();
}

void sample(const Trajectory& trajectory, double t, Eigen::VectorXd& q, Eigen::VectorXd& dq,
            Eigen::VectorXd& ddq) {
  const Eigen::Index last = trajectory.samples() - 1;
  const double* const times = trajectory.t.data();
  if (t < times[0] || t > times[last]) {
    q = trajectory.q.row(t < times[0] ? 0 : last).transpose();
    dq.setZero(trajectory.joints());
    ddq.setZero(trajectory.joints());
    return;
  }
  const Eigen::Index i = std::upper_bound(times, times + last + 1, t) - times - 1;
  if (i == last || t == times[i]) {
    q = trajectory.q.row(i).transpose();
    dq = trajectory.dq.row(i).transpose();
    ddq = trajectory.ddq.row(i).transpose();
    return;
  }
  const double h = times[i + 1] - times[i], u = (t - times[i]) / h;
  q.resize(trajectory.joints());
  dq.resize(trajectory.joints());
  ddq.resize(trajectory.joints());
  for (Eigen::Index j = 0; j < trajectory.q.cols(); ++j) {
    // Over u in 0..1: c0 + c1 u + ... + c5 u^5, whose first three terms are the state on the left; the rest
    // makes up for what they miss of the state on the right.
    const double c0 = trajectory.q(i, j), c1 = h * trajectory.dq(i, j),
                 c2 = 0.5 * h * h * trajectory.ddq(i, j);
    const double p = trajectory.q(i + 1, j) - (c0 + c1 + c2);
    const double v = h * trajectory.dq(i + 1, j) - (c1 + 2.0 * c2);
    const double a = h * h * trajectory.ddq(i + 1, j) - 2.0 * c2;
    const double c3 = 10.0 * p - 4.0 * v + 0.5 * a;
    const double c4 = -15.0 * p + 7.0 * v - a;
    const double c5 = 6.0 * p - 3.0 * v + 0.5 * a;
    q[j] = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))));
    dq[j] = (c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h;
    ddq[j] = (2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (h * h);
  }
}

}  // namespace dynid
