// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/gap_motion.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/dynamics/regressor.hpp"
#include "dynid/dynamics/workspace.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/signal/filter.hpp"

namespace dynid {
namespace {

constexpr Eigen::Index samples_of_a_task = 512;

/// Calls use(i, Y) with the regressor (n x 10 n) of each of the `count` samples from `first` on.
template <class Use>
void for_each_regressor(const Model<>& model, const GapMotion& motion, Eigen::Index first, Eigen::Index count,
                        Use&& use) {
  Workspace<> ws(model);
  Eigen::MatrixXd Y(model.size(), 10 * model.size());
  Eigen::VectorXd q(model.size()), dq(model.size()), ddq(model.size());
  for (Eigen::Index i = first; i < first + count; ++i) {
    q = motion.q.row(i);
    dq = motion.dq.row(i);
    ddq = motion.ddq.row(i);
    regressor(model, ws, q, dq, ddq, Y);
    use(i, std::as_const(Y));
  }
}

}  // namespace

GapMotion::GapMotion(const Robot& nominal_robot, Segment segment, double log_start)
    : rate(segment.rate),
      start(log_start),
      t(segment.t.array() - log_start),
      q(std::move(segment.q)),
      dq(std::move(segment.dq)),
      ddq(std::move(segment.ddq)),
      speed(segment.speed.size() > 0 ? std::move(segment.speed) : dq),
      tau(std::move(segment.tau)),
      robot_(nominal_robot),
      model_(nominal_robot) {
  const int n = robot_.size();
  const Eigen::Index N = q.rows();
  Workspace<> ws(model_);
  nominal.resize(N, n);
  rigid.resize(N, n);
  worked = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd qi(n), vi(n), ai(n), torque(n);
  for (Eigen::Index i = 0; i < N; ++i) {
    qi = q.row(i);
    vi = dq.row(i);
    ai = ddq.row(i);
    inverse_dynamics(model_, ws, qi, vi, ai, torque);
    for (int j = 0; j < n; ++j) {
      const Joint& joint = robot_.joints[static_cast<std::size_t>(j)];
      rigid(i, j) = torque[j] + joint.rotor_inertia * ai[j];
      nominal(i, j) = rigid(i, j) + friction_torque(joint.friction, speed(i, j));
    }
  }
}

GapMotion GapMotion::part(Eigen::Index first, Eigen::Index count) const {
  GapMotion out(*this, first, count);
  out.worked = worked + (speed.topRows(first).colwise().squaredNorm() / rate).transpose();
  return out;
}

GapMotion::GapMotion(const GapMotion& of, Eigen::Index first, Eigen::Index count)
    : rate(of.rate),
      start(of.start),
      t(of.t.segment(first, count)),
      q(of.q.middleRows(first, count)),
      dq(of.dq.middleRows(first, count)),
      ddq(of.ddq.middleRows(first, count)),
      speed(of.speed.middleRows(first, count)),
      tau(of.tau.middleRows(first, count)),
      nominal(of.nominal.middleRows(first, count)),
      known(of.known.size() > 0 ? Eigen::MatrixXd(of.known.middleRows(first, count)) : Eigen::MatrixXd()),
      rigid(of.rigid.middleRows(first, count)),
      robot_(of.robot_),
      model_(of.model_) {}

std::vector<Eigen::MatrixXd> GapMotion::regressor_rows(Eigen::Index first, Eigen::Index count) const {
  const int n = robot_.size();
  std::vector<Eigen::MatrixXd> out(static_cast<std::size_t>(n), Eigen::MatrixXd(count, 10 * n));
  for_each_regressor(model_, *this, first, count, [&](Eigen::Index i, const Eigen::MatrixXd& Y) {
    for (int j = 0; j < n; ++j) out[static_cast<std::size_t>(j)].row(i - first) = Y.row(j);
  });
  return out;
}

std::vector<Eigen::MatrixXd> GapMotion::link_columns(int link) const {
  std::vector<Eigen::MatrixXd> out(static_cast<std::size_t>(link) + 1, Eigen::MatrixXd(q.rows(), 10));
  tbb::parallel_for(tbb::blocked_range<Eigen::Index>(0, q.rows(), samples_of_a_task), [&](const auto& part) {
    for_each_regressor(model_, *this, part.begin(), part.end() - part.begin(),
                       [&](Eigen::Index i, const Eigen::MatrixXd& Y) {
                         for (int j = 0; j <= link; ++j)
                           out[static_cast<std::size_t>(j)].row(i) = Y.row(j).segment<10>(10 * link);
                       });
  });
  return out;
}

Eigen::MatrixXd GapMotion::along(const Eigen::MatrixXd& d_q, const Eigen::MatrixXd& d_dq,
                                 const Eigen::MatrixXd& d_ddq) const {
  // Central differences with a step of 1e-4 of a unit change: the torques are smooth, curvature leaves 1e-8.
  constexpr double step = 1e-4;
  const int n = robot_.size();
  Eigen::MatrixXd out(q.rows(), n);
  tbb::parallel_for(tbb::blocked_range<Eigen::Index>(0, q.rows(), samples_of_a_task), [&](const auto& part) {
    Workspace<> ws(model_);
    Eigen::VectorXd ahead(n), behind(n), x(n), v(n), a(n);
    for (Eigen::Index i = part.begin(); i < part.end(); ++i) {
      for (const double s : {step, -step}) {
        x = (q.row(i) + s * d_q.row(i)).transpose();
        v = (dq.row(i) + s * d_dq.row(i)).transpose();
        a = (ddq.row(i) + s * d_ddq.row(i)).transpose();
        inverse_dynamics(model_, ws, x, v, a, s > 0.0 ? ahead : behind);
      }
      out.row(i) = (ahead - behind).transpose() / (2.0 * step);
    }
  });
  return out;
}

void GapMotion::keep_shared() const {
  if (!slopes_.empty()) return;
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(q.rows(), robot_.size());
  for (int j = 0; j < robot_.size(); ++j) {
    Eigen::MatrixXd unit = none;
    unit.col(j).setOnes();
    slopes_.push_back({along(unit, none, none), along(none, unit, none), along(none, none, unit)});
  }
  poses_ = poses(0, q.rows());
}

std::vector<GapMotion::Pose> GapMotion::poses(Eigen::Index first, Eigen::Index count) const {
  Workspace<> ws(model_);
  std::vector<Eigen::Isometry3d> here(static_cast<std::size_t>(robot_.size()) + 1);
  std::vector<Pose> out;
  out.reserve(static_cast<std::size_t>(count * robot_.size()));
  for (Eigen::Index i = 0; i < count; ++i) {
    forward_kinematics(model_, ws, q.row(first + i).transpose(), here);
    for (int j = 0; j < robot_.size(); ++j) out.emplace_back(here[static_cast<std::size_t>(j)]);
  }
  return out;
}

Eigen::MatrixXd GapMotion::shifted(int joint, const Eigen::VectorXd& d) const {
  const Eigen::VectorXd speed_of_d = differentiate(d, rate);
  const Eigen::VectorXd acceleration_of_d = differentiate(speed_of_d, rate);
  if (slopes_.empty()) {
    const auto unit = [&](const Eigen::VectorXd& x) {
      Eigen::MatrixXd all = Eigen::MatrixXd::Zero(q.rows(), robot_.size());
      all.col(joint) = x;
      return all;
    };
    return along(unit(d), unit(speed_of_d), unit(acceleration_of_d));
  }
  const Slopes& slope = slopes_[static_cast<std::size_t>(joint)];
  return d.asDiagonal() * slope[0] + speed_of_d.asDiagonal() * slope[1] +
         acceleration_of_d.asDiagonal() * slope[2];
}

Eigen::VectorXd GapMotion::inertia(int joint) const {
  if (!slopes_.empty()) return slopes_[static_cast<std::size_t>(joint)][2].col(joint);
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(q.rows(), robot_.size());
  Eigen::MatrixXd unit = none;
  unit.col(joint).setOnes();
  return along(none, none, unit).col(joint);
}

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

std::vector<Eigen::MatrixXd> GapMotion::force_columns(int link, const Eigen::Vector3d& point,
                                                      Eigen::Index first, Eigen::Index count) const {
  const std::vector<Pose> made = poses_.empty() ? poses(first, count) : std::vector<Pose>();
  const Pose* here = poses_.empty() ? made.data() : poses_.data() + first * robot_.size();
  std::vector<Eigen::MatrixXd> out(static_cast<std::size_t>(link) + 1, Eigen::MatrixXd(count, 3));
  for (Eigen::Index i = 0; i < count; ++i, here += robot_.size()) {
    const Eigen::Vector3d at = here[link] * point;
    for (std::size_t j = 0; j < out.size(); ++j) {
      const Eigen::Vector3d axis = here[j].linear() * robot_.joints[j].axis;
      const bool slides = robot_.joints[j].type == JointType::prismatic;
      out[j].row(i) = (slides ? axis : Eigen::Vector3d(axis.cross(at - here[j].translation()))).transpose();
    }
  }
  return out;
}

}  // namespace dynid
