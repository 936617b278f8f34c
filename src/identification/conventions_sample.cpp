// SPDX-License-Identifier: Apache-2.0
#include "conventions_sample.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/regressor.hpp"

namespace dynid::detail {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double smooth_part = 0.1;  // of a joint's rms speed: where Coulomb friction changes its sign

Eigen::MatrixXd orthonormal(Eigen::MatrixXd columns) {
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    const double size = columns.col(k).norm();
    for (int pass = 0; pass < 2; ++pass)
      for (Eigen::Index i = 0; i < k; ++i)
        columns.col(k) -= columns.col(i) * columns.col(i).dot(columns.col(k));
    const double left = columns.col(k).norm();
    if (left > 1e-9 * size && left > 0.0)
      columns.col(k) /= left;
    else
      columns.col(k).setZero();
  }
  return columns;
}

/// Least value of whole - 2 b x + x G x with no entry of x negative, over the eight sets of those that are
/// not zero; the third, the rotor's, at most `bound`.
double least_residual(const Eigen::Matrix3d& G, const Eigen::Vector3d& b, double whole, double bound,
                      Eigen::Vector3d& best) {
  double left = whole;
  best.setZero();
  for (int set = 1; set < 16; ++set) {
    if ((set & 8) && ((set & 4) || !std::isfinite(bound))) continue;
    Eigen::Vector3d x = Eigen::Vector3d::Zero(), c = b;
    if (set & 8) {
      x[2] = bound;
      c -= G.col(2) * bound;
    }
    std::array<int, 3> in{};
    int m = 0;
    for (int i = 0; i < 3; ++i)
      if (set & (1 << i)) in[m++] = i;
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
    Eigen::Vector3d y = Eigen::Vector3d::Zero();
    for (int i = 0; i < m; ++i) {
      y[i] = c[in[i]];
      for (int l = 0; l < m; ++l)
        A(i, l) = G(in[i], in[l]) + (i == l ? 1e-12 * G(in[i], in[i]) + 1e-300 : 0.0);
    }
    const Eigen::Vector3d s = A.ldlt().solve(y);
    bool good = true;
    for (int i = 0; i < m; ++i) {
      good = good && std::isfinite(s[i]) && s[i] >= 0.0 && !(in[i] == 2 && s[i] > bound);
      x[in[i]] = s[i];
    }
    if (!good) continue;
    const double now = whole - 2.0 * b.dot(x) + x.dot(G * x);
    if (now < left) left = now, best = x;
  }
  return std::max(left, 0.0);
}

/// Kernels for N joints.
template <int N>
class Kernel final : public NominalKernel {
 public:
  explicit Kernel(const Robot& robot)
      : model_(robot),
        packets_(model_),
        ws_(model_),
        q_(robot.size()),
        dq_(robot.size()),
        ddq_(robot.size()),
        tau_(robot.size()) {}

  void torque(const ConventionSample& sample, const Reading& reading, const Eigen::Vector3d& g,
              Eigen::MatrixXd& out) override {
    const int n = sample.joints();
    sample.motion(reading, Q_, V_, A_);
    model_.set_gravity(g);
    out.resize(sample.rows(), n);
    for (Eigen::Index b = 0; b < sample.rows() / 8; ++b) {
      const Eigen::Map<const Eigen::Matrix<Packet8, Eigen::Dynamic, 1>> q(&Q_[b * n], n), v(&V_[b * n], n),
          a(&A_[b * n], n);
      inverse_dynamics(model_, packets_, q, v, a, tau_);
      for (int j = 0; j < n; ++j) out.block<8, 1>(8 * b, j) = tau_[j].matrix();
    }
  }

  void link(const ConventionSample& sample, const Reading& reading, int link,
            std::vector<Eigen::MatrixXd>& out) override {
    const int n = sample.joints();
    sample.motion(reading, Q_, V_, A_);
    model_.set_gravity(reading.gravity);
    out.assign(n, Eigen::MatrixXd(sample.rows(), 10));
    Eigen::MatrixXd Y(n, 10 * n);
    for (Eigen::Index i = 0; i < sample.rows(); ++i) {
      for (int j = 0; j < n; ++j) {
        const auto at = (i / 8) * n + j;
        q_[j] = Q_[at][i % 8], dq_[j] = V_[at][i % 8], ddq_[j] = A_[at][i % 8];
      }
      regressor(model_, ws_, q_, dq_, ddq_, Y);
      for (int j = 0; j < n; ++j) out[j].row(i) = Y.row(j).segment<10>(10 * link);
    }
  }

 private:
  Model<N> model_;
  Workspace<N, Packet8> packets_;
  Workspace<N> ws_;
  Eigen::VectorXd q_, dq_, ddq_;
  Eigen::Matrix<Packet8, Eigen::Dynamic, 1> tau_;
  std::vector<Packet8> Q_, V_, A_;
};

}  // namespace

std::unique_ptr<NominalKernel> make_kernel(const Robot& robot) {
  if (robot.size() == 6) return std::make_unique<Kernel<6>>(robot);
  if (robot.size() == 7) return std::make_unique<Kernel<7>>(robot);
  return std::make_unique<Kernel<Eigen::Dynamic>>(robot);
}

ConventionSample::ConventionSample(const Robot& robot, const SpreadRows& rows, Eigen::Index count,
                                   const Eigen::VectorXd& most_rotor)
    : n_(robot.size()), blocks_(std::min(count, rows.q.rows()) / 8), most_rotor_(most_rotor) {
  const Eigen::Index M = 8 * blocks_;
  for (const Joint& joint : robot.joints) revolute_.push_back(joint.type != JointType::prismatic);
  for (Eigen::Index b = 0; b < blocks_; ++b) {
    for (int k = 0; k < n_; ++k) {
      q_.emplace_back(rows.q.block<8, 1>(8 * b, k).array());
      dq_.emplace_back(rows.dq.block<8, 1>(8 * b, k).array());
      ddq_.emplace_back(rows.ddq.block<8, 1>(8 * b, k).array());
    }
  }
  tau_ = rows.tau.topRows(M);
  bare_ = tau_;
  energy_.resize(n_);
  bodyless_.resize(n_);
  for (int k = 0; k < n_; ++k) {
    Eigen::MatrixXd columns(M, 4);
    const Eigen::ArrayXd v = rows.dq.col(k).head(M).array();
    const double speed = std::sqrt(v.square().mean());
    columns.col(0).setOnes();
    columns.col(1) = (v / std::max(smooth_part * speed, 1e-300)).tanh();
    columns.col(2) = v;
    columns.col(3) = rows.ddq.col(k).head(M);
    friction_.emplace_back(columns.rightCols(3).rowwise() - columns.rightCols(3).colwise().mean());
    gram_.emplace_back(friction_.back().transpose() * friction_.back());
    basis_.push_back(orthonormal(columns));
    project(k, bare_.col(k));
    const Eigen::MatrixXd U = basis_.back().leftCols(3);
    energy_[k] = (tau_.col(k) - U * (U.transpose() * tau_.col(k))).squaredNorm();
    // What no rigid body is needed for: friction and rotor inertia of any size, the torque turned either way.
    const Eigen::VectorXd centred = tau_.col(k).array() - tau_.col(k).mean();
    const Eigen::Vector3d b = friction_[k].transpose() * centred;
    Eigen::Vector3d x;
    bodyless_[k] = std::min(least_residual(gram_[k], b, centred.squaredNorm(), infinity, x),
                            least_residual(gram_[k], -b, centred.squaredNorm(), infinity, x));
    bodyless_[k] /= std::max(energy_[k], 1e-300);
  }
}

void ConventionSample::motion(const Reading& r, std::vector<Packet8>& q, std::vector<Packet8>& dq,
                              std::vector<Packet8>& ddq) const {
  q.resize(q_.size()), dq.resize(q_.size()), ddq.resize(q_.size());
  for (int j = 0; j < n_; ++j) {
    const double unit = r.sign[j] * (revolute_[j] ? r.position_unit : 1.0), v = unit / r.time_unit,
                 a = v / r.time_unit;
    for (Eigen::Index b = 0; b < blocks_; ++b) {
      const auto from = b * n_ + r.order[j], to = b * n_ + j;
      q[to] = unit * q_[from] + r.zero[j];
      dq[to] = v * dq_[from];
      ddq[to] = a * ddq_[from];
    }
  }
}

void ConventionSample::project(int k, Eigen::Ref<Eigen::MatrixXd> X) const {
  const Eigen::MatrixXd along = basis_[k].transpose() * X;
  X -= basis_[k] * along;
}

double ConventionSample::quick_residual(int j, int k, const Eigen::MatrixXd& T, double torque_sign) const {
  const auto t = T.col(j);
  return bare_.col(k).squaredNorm() - 2.0 * torque_sign * bare_.col(k).dot(t) + t.squaredNorm() -
         (basis_[k].transpose() * t).squaredNorm();
}

double ConventionSample::scale(int k, int j, const Eigen::MatrixXd& T, double& correlation) const {
  const auto U = basis_[k].leftCols(3);
  const Eigen::VectorXd t = T.col(j) - U * (U.transpose() * T.col(j));
  const double size = t.squaredNorm(), along = t.dot(tau_.col(k));
  correlation = size > 0.0 && energy_[k] > 0.0 ? along / std::sqrt(size * energy_[k]) : 0.0;
  return size > 0.0 ? along / size : 0.0;
}

Eigen::Vector3d ConventionSample::fit(const Reading& reading, int j, const Eigen::VectorXd& r,
                                      double most_rotor, double& left) const {
  const int k = reading.order[j];
  const Eigen::VectorXd centred = r.array() - r.mean();
  const Eigen::Vector3d b = reading.sign[j] * (friction_[k].transpose() * centred);
  const Eigen::Matrix3d& G = gram_[k];
  const double whole = centred.squaredNorm();
  const double unit = revolute_[j] ? reading.position_unit : 1.0;
  Eigen::Vector3d best;
  left = least_residual(G, b, whole, most_rotor * unit / (reading.time_unit * reading.time_unit), best);
  return best;
}

double ConventionSample::residual(const Reading& reading, int j, const Eigen::MatrixXd& T, double torque_sign,
                                  double factor) const {
  const int k = reading.order[j];
  double left = 0.0;
  fit(reading, j, torque_sign * factor * tau_.col(k) - T.col(j), most_rotor_[j], left);
  return energy_[k] > 0.0 ? left / (factor * factor * energy_[k]) : 1.0;
}

double ConventionSample::bare_part(const Reading& reading, int j, const Eigen::MatrixXd& T) const {
  const Eigen::VectorXd tau = reading.torque_sign[j] * tau_.col(reading.order[j]);
  double with = 0.0, without = 0.0;
  fit(reading, j, tau, 0.0, without);
  fit(reading, j, tau - T.col(j), 0.0, with);
  return without > 0.0 ? with / without : 1.0;
}

Eigen::VectorXd ConventionSample::fitted(const Reading& reading, int j,
                                         const Eigen::VectorXd& residual) const {
  double left = 0.0;
  const Eigen::Vector3d x = fit(reading, j, residual, most_rotor_[j], left);
  const int k = reading.order[j];
  return reading.sign[j] * (friction_[k] * x);
}

}  // namespace dynid::detail
