// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/gap_motion.hpp"

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/dynamics/regressor.hpp"
#include "dynid/dynamics/workspace.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/signal/filter.hpp"

namespace dynid {

GapMotion::GapMotion(const Robot& nominal_robot, const Segment& segment, double log_start)
    : rate(segment.rate),
      start(log_start),
      t(segment.t.array() - log_start),
      q(segment.q),
      dq(segment.dq),
      ddq(segment.ddq),
      speed(segment.speed.size() > 0 ? segment.speed : segment.dq),
      tau(segment.tau),
      robot_(nominal_robot),
      model_(nominal_robot) {
  const int n = robot_.size();
  const Eigen::Index N = q.rows();
  Workspace<> ws(model_);
  nominal.resize(N, n);
  rigid.resize(N, n);
  regressor_.assign(static_cast<std::size_t>(n), Eigen::MatrixXd(N, 10 * n));
  Eigen::MatrixXd Y(n, 10 * n);
  Eigen::VectorXd qi(n), vi(n), ai(n), torque(n);
  for (Eigen::Index i = 0; i < N; ++i) {
    qi = q.row(i);
    vi = dq.row(i);
    ai = ddq.row(i);
    inverse_dynamics(model_, ws, qi, vi, ai, torque);
    regressor(model_, ws, qi, vi, ai, Y);
    for (int j = 0; j < n; ++j) {
      const Joint& joint = robot_.joints[static_cast<std::size_t>(j)];
      rigid(i, j) = torque[j] + joint.rotor_inertia * ai[j];
      nominal(i, j) = rigid(i, j) + friction_torque(joint.friction, speed(i, j));
      regressor_[static_cast<std::size_t>(j)].row(i) = Y.row(j);
    }
  }
}

Eigen::MatrixXd GapMotion::link_columns(int link, int joint) const {
  return regressor_[static_cast<std::size_t>(joint)].middleCols(10 * link, 10);
}

Eigen::MatrixXd GapMotion::along(const Eigen::MatrixXd& d_q, const Eigen::MatrixXd& d_dq,
                                 const Eigen::MatrixXd& d_ddq) const {
  // Central differences with a step of 1e-4 of a unit change: the torques are smooth, curvature leaves 1e-8.
  constexpr double step = 1e-4;
  const int n = robot_.size();
  Workspace<> ws(model_);
  Eigen::MatrixXd out(q.rows(), n);
  Eigen::VectorXd ahead(n), behind(n), x(n), v(n), a(n);
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    for (const double s : {step, -step}) {
      x = (q.row(i) + s * d_q.row(i)).transpose();
      v = (dq.row(i) + s * d_dq.row(i)).transpose();
      a = (ddq.row(i) + s * d_ddq.row(i)).transpose();
      inverse_dynamics(model_, ws, x, v, a, s > 0.0 ? ahead : behind);
    }
    out.row(i) = (ahead - behind).transpose() / (2.0 * step);
  }
  return out;
}

const GapMotion::Slopes& GapMotion::slopes(int joint) const {
  if (slopes_.empty()) {
    const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(q.rows(), robot_.size());
    for (int j = 0; j < robot_.size(); ++j) {
      Eigen::MatrixXd unit = none;
      unit.col(j).setOnes();
      slopes_.push_back({along(unit, none, none), along(none, unit, none), along(none, none, unit)});
    }
  }
  return slopes_[static_cast<std::size_t>(joint)];
}

Eigen::MatrixXd GapMotion::shifted(int joint, const Eigen::VectorXd& d) const {
  const Slopes& slope = slopes(joint);
  const Eigen::VectorXd speed_of_d = differentiate(d, rate);
  const Eigen::VectorXd acceleration_of_d = differentiate(speed_of_d, rate);
  return d.asDiagonal() * slope[0] + speed_of_d.asDiagonal() * slope[1] +
         acceleration_of_d.asDiagonal() * slope[2];
}

Eigen::VectorXd GapMotion::inertia(int joint) const { return slopes(joint)[2].col(joint); }

Eigen::MatrixXd GapMotion::gravity_columns(const Eigen::Vector3d& gravity) const {
  const Model<> turned = model_.with_gravity(gravity), none = model_.with_gravity(Eigen::Vector3d::Zero());
  Workspace<> ws(model_);
  const int n = robot_.size();
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd x(n), with(n), without(n);
  Eigen::MatrixXd out(q.rows(), n);
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    x = q.row(i);
    inverse_dynamics(turned, ws, x, zero, zero, with);
    inverse_dynamics(none, ws, x, zero, zero, without);
    out.row(i) = (with - without).transpose();
  }
  return out;
}

Eigen::MatrixXd GapMotion::force_columns(int link, const Eigen::Vector3d& point, int joint) const {
  const int n = robot_.size();
  if (force_.empty()) {
    force_.assign(
        static_cast<std::size_t>(n),
        std::vector<Eigen::MatrixXd>(static_cast<std::size_t>(n), Eigen::MatrixXd::Zero(q.rows(), 12)));
    Workspace<> ws(model_);
    std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(n) + 1);
    for (Eigen::Index i = 0; i < q.rows(); ++i) {
      forward_kinematics(model_, ws, q.row(i).transpose(), poses);
      for (int l = 0; l < n; ++l) {
        for (int j = 0; j <= l; ++j) {
          const Eigen::Isometry3d &frame = poses[static_cast<std::size_t>(j)],
                                  &body = poses[static_cast<std::size_t>(l)];
          const Eigen::Vector3d axis = frame.linear() * robot_.joints[static_cast<std::size_t>(j)].axis;
          auto row = force_[static_cast<std::size_t>(l)][static_cast<std::size_t>(j)].row(i);
          if (robot_.joints[static_cast<std::size_t>(j)].type == JointType::prismatic) {
            row.head<3>() = axis.transpose();
          } else {
            row.head<3>() = axis.cross(body.translation() - frame.translation()).transpose();
            for (int k = 0; k < 3; ++k)
              row.segment<3>(3 + 3 * k) = axis.cross(body.linear().col(k)).transpose();
          }
        }
      }
    }
  }
  const Eigen::MatrixXd& all = force_[static_cast<std::size_t>(link)][static_cast<std::size_t>(joint)];
  return all.leftCols(3) + point[0] * all.middleCols(3, 3) + point[1] * all.middleCols(6, 3) +
         point[2] * all.rightCols(3);
}

}  // namespace dynid
