// SPDX-License-Identifier: Apache-2.0
#include "exciting_objective.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/dynamics/regressor.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid::detail {
namespace {

constexpr int samples_a_cycle = 16;  // of the highest harmonic
constexpr int finer = 3;             // the limits' grid
constexpr double sign_width = 0.05;  // sign(dq) is tanh(dq / v) while searching, v this share of the limit
constexpr double clearance_scale = 0.1;      // [m] that weighs like a whole limit
constexpr double clearance_surplus = 0.005;  // [m] aimed at beyond the clearance
constexpr double difference = 1e-5;          // [rad] in the derivatives by q

Eigen::VectorXd midpoints(const MotionShape& shape, Eigen::Index samples) {
  const double step = shape.duration / double(samples);
  return Eigen::VectorXd::LinSpaced(samples, 0.5 * step, shape.duration - 0.5 * step);
}

}  // namespace

Aim aim(const JointLimits& limits, double margin) {
  const double share = 1.0 - margin;
  const double half = 0.5 * (limits.upper - limits.lower);
  Aim out;
  out.lower = std::isfinite(half) ? limits.lower + margin * half : limits.lower;
  out.upper = std::isfinite(half) ? limits.upper - margin * half : limits.upper;
  out.velocity = share * limits.velocity;
  out.acceleration = share * limits.acceleration;
  out.jerk = share * limits.jerk;
  return out;
}

void ExciteObjective::States::set_zero(Eigen::Index samples, int n) {
  for (Eigen::MatrixXd* x : {&q, &dq, &ddq, &jerk}) x->setZero(samples, n);
}

ExciteObjective::ExciteObjective(const Robot& robot, const BaseParameters& base,
                                 const CollisionModel& collision, const ExciteOptions& options,
                                 const MotionShape& shape, bool free_frequency)
    : robot_(robot),
      base_(base),
      options_(options),
      shape_(shape),
      free_frequency_(free_frequency),
      n_(robot.size()),
      size_(n_ * (2 * shape.harmonics + 1) + (free_frequency ? 1 : 0)),
      columns_(base.size() + (options.regressor.friction ? 3 * n_ : 0)),
      model_(robot),
      packets_(model_),
      workspace_(model_),
      clearances_(robot, collision),
      clearance_(collision.clearance + clearance_surplus) {
  for (Packets* x : {&q_, &dq_, &ddq_, &tau_, &tau_other_}) x->resize(n_);
  Y_.resize(n_, 10 * n_);
  Y_other_.resize(n_, 10 * n_);
  poses_.resize(static_cast<std::size_t>(n_) + 1);
  friction_scale_.resize(n_);
  weight_ = options.regressor.weights.size() > 0 ? options.regressor.weights : Eigen::VectorXd::Ones(n_);
  for (int j = 0; j < n_; ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    friction_scale_[j] = sign_width * joint.limits.velocity;
    if (std::isfinite(joint.limits.torque)) has_torque_ = true;
    std::vector<int> support, standard;
    for (int c = 0; c < base.size(); ++c) {
      const int column = base.columns[static_cast<std::size_t>(c)];
      if (column < base.standard ? column / 10 < j : column - base.standard != j) continue;
      support.push_back(c);
      standard.push_back(column);
    }
    if (options.regressor.friction)
      for (int k = 0; k < 3; ++k) support.push_back(base.size() + 3 * j + k);
    support_.push_back(support);
    standard_.push_back(standard);
  }
  has_torque_ = has_torque_ && robot.parameters().cwiseAbs().maxCoeff() > 0.0;
  rows_.resize(static_cast<std::size_t>(n_));
  pulled_.resize(static_cast<std::size_t>(n_));

  const double cycles = shape.harmonics * shape.omega * shape.duration / (2.0 * M_PI);
  const auto packets =
      std::max<Eigen::Index>(4, static_cast<Eigen::Index>(std::ceil(samples_a_cycle * cycles / 8.0)));
  coarse_.t = midpoints(shape, 8 * packets);
  fine_.t = midpoints(shape, 8 * finer * packets);
}

MotionShape ExciteObjective::shape(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  MotionShape out = shape_;
  if (free_frequency_) out.omega *= std::exp(x[size_ - 1]);
  return out;
}

ExcitingMotion ExciteObjective::motion(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  const MotionShape at = shape(x);
  const int rows = 2 * at.harmonics;
  const Eigen::Map<const Eigen::MatrixXd> free(x.data(), rows, n_);
  return {at, rest_projection(at) * free, x.segment(rows * n_, n_)};
}

Eigen::VectorXd ExciteObjective::unknowns(const Eigen::MatrixXd& coefficients,
                                          const Eigen::VectorXd& offset) const {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(size_);
  x.head(coefficients.size()) = coefficients.reshaped();
  x.segment(coefficients.size(), n_) = offset;
  return x;
}

double ExciteObjective::operator()(const Eigen::Ref<const Eigen::VectorXd>& x, double* gradient) {
  const MotionShape now = shape(x);
  const int rows = 2 * now.harmonics;
  const Eigen::Map<const Eigen::MatrixXd> free(x.data(), rows, n_);
  const Eigen::VectorXd offset = x.segment(rows * n_, n_);
  const Eigen::MatrixXd projection = rest_projection(now);
  const Eigen::MatrixXd coefficients = projection * free;
  const MotionBasis coarse(now, coarse_.t), fine(now, fine_.t);
  const auto move = [&](const MotionBasis& basis, Grid& grid) {
    grid.at.q = (basis.q * coefficients).rowwise() + offset.transpose();
    grid.at.dq = basis.dq * coefficients;
    grid.at.ddq = basis.ddq * coefficients;
    grid.at.jerk = basis.jerk * coefficients;
    grid.slope.set_zero(grid.t.size(), n_);
  };
  move(coarse, coarse_);
  move(fine, fine_);
  const double value = criterion(coarse_) + stiffness_ * limits(fine_);
  if (gradient == nullptr) return value;

  Eigen::Map<Eigen::VectorXd> g(gradient, size_);
  g.setZero();
  Eigen::Map<Eigen::MatrixXd> g_free(gradient, rows, n_);
  Eigen::Ref<Eigen::VectorXd> g_offset = g.segment(rows * n_, n_);
  for (Eigen::MatrixXd* s : {&fine_.slope.q, &fine_.slope.dq, &fine_.slope.ddq, &fine_.slope.jerk})
    *s *= stiffness_;
  pull(coarse_, coarse, projection, g_free, g_offset);
  pull(fine_, fine, projection, g_free, g_offset);
  if (free_frequency_) {  // how the motion moves with log w, projection included, by central differences
    constexpr double h = 1e-5;
    double slope = 0.0;
    for (const double side : {-1.0, 1.0}) {
      MotionShape other = now;
      other.omega *= std::exp(side * h);
      const Eigen::MatrixXd c = rest_projection(other) * free;
      for (const Grid* grid : {&coarse_, &fine_}) {
        const MotionBasis basis(other, grid->t);
        const auto along = [&](const Eigen::MatrixXd& terms, const Eigen::MatrixXd& s) {
          return (terms * c).cwiseProduct(s).sum();
        };
        slope += side / (2.0 * h) *
                 (along(basis.q, grid->slope.q) + along(basis.dq, grid->slope.dq) +
                  along(basis.ddq, grid->slope.ddq) + along(basis.jerk, grid->slope.jerk));
      }
    }
    g[size_ - 1] = slope;
  }
  return value;
}

void ExciteObjective::pull(const Grid& grid, const MotionBasis& basis, const Eigen::MatrixXd& projection,
                           Eigen::Ref<Eigen::MatrixXd> coefficients,
                           Eigen::Ref<Eigen::VectorXd> offset) const {
  const Eigen::MatrixXd slope = basis.q.transpose() * grid.slope.q + basis.dq.transpose() * grid.slope.dq +
                                basis.ddq.transpose() * grid.slope.ddq +
                                basis.jerk.transpose() * grid.slope.jerk;
  coefficients += projection * slope;
  offset += grid.slope.q.colwise().sum().transpose();
}

void ExciteObjective::load(const States& at, Eigen::Index first) {
  for (int j = 0; j < n_; ++j) {
    q_[j] = at.q.col(j).segment<8>(first).array();
    dq_[j] = at.dq.col(j).segment<8>(first).array();
    ddq_[j] = at.ddq.col(j).segment<8>(first).array();
  }
}

double ExciteObjective::criterion(Grid& grid) {
  const Eigen::Index samples = grid.t.size();
  const bool friction = options_.regressor.friction;
  for (int j = 0; j < n_; ++j) {
    const auto at = static_cast<std::size_t>(j);
    rows_[at].resize(samples, static_cast<Eigen::Index>(support_[at].size()));
    if (!friction) continue;
    const Eigen::Index last = rows_[at].cols();
    rows_[at].col(last - 3) = weight_[j] * grid.at.dq.col(j);
    rows_[at].col(last - 2) = weight_[j] * (grid.at.dq.col(j) / friction_scale_[j]).array().tanh().matrix();
    rows_[at].col(last - 1).setConstant(weight_[j]);
  }
  for (Eigen::Index first = 0; first < samples; first += 8) {
    load(grid.at, first);
    regressor(model_, packets_, q_, dq_, ddq_, Y_);
    for (int j = 0; j < n_; ++j) {
      const auto at = static_cast<std::size_t>(j);
      for (std::size_t c = 0; c < standard_[at].size(); ++c) {
        const int column = standard_[at][c];
        auto out = rows_[at].col(static_cast<Eigen::Index>(c)).segment<8>(first).array();
        out = weight_[j] * (column < base_.standard ? Y_(j, column) : ddq_[j]);
      }
    }
  }

  // The information matrix: its squared condition stays far from rounding for any motion worth having.
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(columns_, columns_);
  for (int j = 0; j < n_; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const Eigen::Index p = rows_[at].cols();
    Eigen::MatrixXd part = Eigen::MatrixXd::Zero(p, p);
    part.selfadjointView<Eigen::Lower>().rankUpdate(rows_[at].transpose(), 1.0 / double(samples));
    for (Eigen::Index c = 0; c < p; ++c)
      for (Eigen::Index r = c; r < p; ++r)
        G(support_[at][static_cast<std::size_t>(r)], support_[at][static_cast<std::size_t>(c)]) += part(r, c);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(G);
  const Eigen::VectorXd lambda = eigen.eigenvalues().cwiseMax(1e-14 * eigen.eigenvalues().maxCoeff());
  double value = 0.0;
  Eigen::VectorXd d(columns_);  // of the value by each eigenvalue
  if (options_.criterion == ExcitationCriterion::determinant) {
    value = -lambda.array().log().sum() / columns_;
    d = -lambda.cwiseInverse() / columns_;
  } else {
    // log of the condition number, the extreme eigenvalues read as power means.
    const double k = exponent_, most = lambda[columns_ - 1], least = lambda[0];
    const Eigen::ArrayXd high = (lambda.array() / most).pow(k), low = (least / lambda.array()).pow(k);
    value = 0.5 * (std::log(most / least) + (std::log(high.sum()) + std::log(low.sum())) / k);
    d = 0.5 * (high / high.sum() - low / low.sum()) / lambda.array();
  }
  const Eigen::MatrixXd W = eigen.eigenvectors() * d.asDiagonal() * eigen.eigenvectors().transpose();

  // dvalue = tr(W dG) = 2/N sum_i tr(W A_i^T dA_i): pulled_ holds 2/N A W on each joint's support.
  for (int j = 0; j < n_; ++j) {
    const auto at = static_cast<std::size_t>(j);
    pulled_[at].noalias() = (2.0 * weight_[j] / double(samples)) * rows_[at] * W(support_[at], support_[at]);
    if (!friction) continue;
    const Eigen::Index last = rows_[at].cols();
    const Eigen::ArrayXd s = (grid.at.dq.col(j) / friction_scale_[j]).array().tanh();
    grid.slope.dq.col(j).array() += pulled_[at].col(last - 3).array() +
                                    pulled_[at].col(last - 2).array() * (1.0 - s * s) / friction_scale_[j];
  }
  const auto along = [&](Eigen::Index first) {  // <pulled, Y - Y_other>
    Packet8 sum = Packet8::Zero();
    for (int j = 0; j < n_; ++j) {
      const auto at = static_cast<std::size_t>(j);
      for (std::size_t c = 0; c < standard_[at].size(); ++c) {
        const int column = standard_[at][c];
        if (column >= base_.standard) continue;
        sum += pulled_[at].col(static_cast<Eigen::Index>(c)).segment<8>(first).array() *
               (Y_(j, column) - Y_other_(j, column));
      }
    }
    return sum;
  };
  for (Eigen::Index first = 0; first < samples; first += 8) {
    load(grid.at, first);
    // Central differences: exact, whatever the step, in dq and ddq, of which the regressor is a polynomial of
    // degree two and one.
    const auto slope = [&](Packet8& variable, double step) {
      const Packet8 here = variable;
      variable = here + step;
      regressor(model_, packets_, q_, dq_, ddq_, Y_);
      variable = here - step;
      regressor(model_, packets_, q_, dq_, ddq_, Y_other_);
      variable = here;
      return Packet8(along(first) / (2.0 * step));
    };
    for (int k = 0; k < n_; ++k) {
      grid.slope.q.col(k).segment<8>(first).array() += slope(q_[k], difference);
      grid.slope.dq.col(k).segment<8>(first).array() += slope(dq_[k], 1.0);
      grid.slope.ddq.col(k).segment<8>(first).array() += slope(ddq_[k], 1.0);
    }
    if (!base_.rotor_inertia) continue;
    for (int j = 0; j < n_; ++j) {
      const auto at = static_cast<std::size_t>(j);
      for (std::size_t c = 0; c < standard_[at].size(); ++c)
        if (standard_[at][c] >= base_.standard)
          grid.slope.ddq.col(j).segment<8>(first) +=
              pulled_[at].col(static_cast<Eigen::Index>(c)).segment<8>(first);
    }
  }
  return value;
}

double ExciteObjective::limits(Grid& grid) {
  double value = 0.0;
  const Eigen::Index samples = grid.t.size();
  // Squares of what is beyond the aim, as a share of the limit.
  const auto beyond = [&value](double excess, double scale, double sign, double& slope) {
    if (!(excess > 0.0)) return;
    const double share = excess / scale;
    value += share * share;
    slope += sign * 2.0 * share / scale;
  };
  const auto below = [&](const Eigen::MatrixXd& x, Eigen::MatrixXd& slope, int j, double limit) {
    if (!std::isfinite(limit)) return;
    for (Eigen::Index i = 0; i < samples; ++i)
      beyond(std::abs(x(i, j)) - limit, limit, x(i, j) < 0.0 ? -1.0 : 1.0, slope(i, j));
  };
  for (int j = 0; j < n_; ++j) {
    const JointLimits& limits = robot_.joints[static_cast<std::size_t>(j)].limits;
    const Aim to = aim(limits, options_.margin);
    const double half =
        std::isfinite(limits.upper - limits.lower) ? 0.5 * (limits.upper - limits.lower) : 1.0;
    for (Eigen::Index i = 0; i < samples; ++i) {
      if (std::isfinite(to.lower)) beyond(to.lower - grid.at.q(i, j), half, -1.0, grid.slope.q(i, j));
      if (std::isfinite(to.upper)) beyond(grid.at.q(i, j) - to.upper, half, 1.0, grid.slope.q(i, j));
    }
    below(grid.at.dq, grid.slope.dq, j, to.velocity);
    below(grid.at.ddq, grid.slope.ddq, j, to.acceleration);
    below(grid.at.jerk, grid.slope.jerk, j, to.jerk);
  }
  if (has_torque_)
    for (Eigen::Index first = 0; first < samples; first += 8) value += torque(grid, first);
  if (!clearances_.pairs().empty())
    for (Eigen::Index i = 0; i < samples; ++i) value += clearance(grid, i);
  return value;
}

double ExciteObjective::torque(Grid& grid, Eigen::Index first) {
  load(grid.at, first);
  inverse_dynamics(model_, packets_, q_, dq_, ddq_, tau_);
  double value = 0.0;
  bool broken = false;
  Packets pull(n_);  // of the value by each torque
  for (int j = 0; j < n_; ++j) {
    const Joint& joint = robot_.joints[static_cast<std::size_t>(j)];
    const double limit = (1.0 - options_.margin) * joint.limits.torque;
    pull[j].setZero();
    if (!std::isfinite(limit)) continue;
    for (int k = 0; k < 8; ++k) {
      const double tau =
          tau_[j][k] + joint.rotor_inertia * ddq_[j][k] + friction_torque(joint.friction, dq_[j][k]);
      const double share = (std::abs(tau) - limit) / limit;
      if (!(share > 0.0)) continue;
      broken = true;
      value += share * share;
      pull[j][k] = (tau < 0.0 ? -2.0 : 2.0) * share / limit;
      grid.slope.dq(first + k, j) += pull[j][k] * friction_slope(joint.friction, dq_[j][k]);
      grid.slope.ddq(first + k, j) += pull[j][k] * joint.rotor_inertia;
    }
  }
  if (!broken) return value;
  const auto slope = [&](Packet8& variable, double step) {
    const Packet8 here = variable;
    variable = here + step;
    inverse_dynamics(model_, packets_, q_, dq_, ddq_, tau_);
    variable = here - step;
    inverse_dynamics(model_, packets_, q_, dq_, ddq_, tau_other_);
    variable = here;
    Packet8 sum = Packet8::Zero();
    for (int j = 0; j < n_; ++j) sum += pull[j] * (tau_[j] - tau_other_[j]);
    return Packet8(sum / (2.0 * step));
  };
  for (int k = 0; k < n_; ++k) {
    grid.slope.q.col(k).segment<8>(first).array() += slope(q_[k], difference);
    grid.slope.dq.col(k).segment<8>(first).array() += slope(dq_[k], 1.0);
    grid.slope.ddq.col(k).segment<8>(first).array() += slope(ddq_[k], 1.0);
  }
  return value;
}

double ExciteObjective::clearance(Grid& grid, Eigen::Index sample) {
  forward_kinematics(model_, workspace_, grid.at.q.row(sample).transpose(), poses_);
  clearances_.near(poses_, clearance_, near_);
  double value = 0.0;
  for (const Proximity& near : near_) {
    const Clearances::Pair& pair = clearances_.pairs()[static_cast<std::size_t>(near.pair)];
    const double share = (clearance_ - near.distance) / clearance_scale;
    value += share * share;
    for (int k = 0; k < std::max(pair.moving_a, pair.moving_b); ++k) {
      const Joint& joint = robot_.joints[static_cast<std::size_t>(k)];
      const Eigen::Isometry3d& pose = poses_[static_cast<std::size_t>(k)];
      const Eigen::Vector3d axis = pose.linear() * joint.axis;
      const auto velocity = [&](const Eigen::Vector3d& point) -> Eigen::Vector3d {
        return joint.type == JointType::prismatic ? axis : axis.cross(point - pose.translation()).eval();
      };
      double rate = 0.0;  // of the distance by q_k
      if (k < pair.moving_b) rate += near.normal.dot(velocity(near.on_b));
      if (k < pair.moving_a) rate -= near.normal.dot(velocity(near.on_a));
      grid.slope.q(sample, k) -= 2.0 * share / clearance_scale * rate;
    }
  }
  return value;
}

}  // namespace dynid::detail
