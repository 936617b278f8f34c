// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/computed_torque.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/friction/friction.hpp"
#include "rigid_body.hpp"

namespace dynid {

ComputedTorque::ComputedTorque(const Robot& nominal, const ControlGains& gains)
    : model_(nominal),
      ws_(model_),
      gains_(gains),
      rotor_(detail::rotor_inertias(nominal)),
      drive_(nominal.size()),
      integral_(Eigen::VectorXd::Zero(nominal.size())),
      feedback_(nominal.size()),
      reference_(nominal.size()),
      friction_(detail::smooth_friction(nominal)) {
  const int n = nominal.size();
  const std::vector<JointScale> scales = joint_scales(nominal);
  // What a joint's torque moves when the others are free, 1 / (M^-1)_jj, is less than M_jj: over poses, the
  // least.
  constexpr int poses = 64;
  Eigen::VectorXd q(n), least = Eigen::VectorXd::Constant(n, HUGE_VAL);
  Eigen::MatrixXd M(n, n);
  std::vector<Eigen::MatrixXd> inverses;
  std::mt19937_64 random(1);
  for (int k = 0; k < poses; ++k) {
    for (int j = 0; j < n; ++j) {
      const JointLimits& limits = nominal.joints[static_cast<std::size_t>(j)].limits;
      const bool bounded = std::isfinite(limits.lower) && std::isfinite(limits.upper);
      const double half = 0.5 * scales[static_cast<std::size_t>(j)].travel;
      const double low = bounded ? limits.lower : -half, high = bounded ? limits.upper : half;
      q[j] = low + (high - low) * (double(random() >> 11) * 0x1p-53);
    }
    mass_matrix(model_, ws_, q, M, rotor_);
    inverses.emplace_back(M.ldlt().solve(Eigen::MatrixXd::Identity(n, n)));
    for (int j = 0; j < n; ++j) least[j] = std::min(least[j], 1.0 / inverses.back()(j, j));
  }
  for (std::size_t j = 0; j < scales.size(); ++j) {
    const bool slides = scales[j].type == JointType::prismatic;
    double largest = 0.0;
    for (const JointScale& s : scales)
      if ((s.type == JointType::prismatic) == slides) largest = std::max(largest, s.inertia);
    const auto i = static_cast<Eigen::Index>(j);
    drive_[i] = least[i] > 0.0 ? std::min(gains.drive * largest, gains.most_drive * least[i]) : 0.0;
  }
  // Together they multiply the bandwidth of some motion of the arm by up to 1 + the largest eigenvalue of
  // M^-1 D.
  const Eigen::VectorXd root = drive_.cwiseSqrt();
  double most = 0.0;
  for (const Eigen::MatrixXd& inverse : inverses)
    most = std::max(most, Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(
                              root.asDiagonal() * inverse * root.asDiagonal(), Eigen::EigenvaluesOnly)
                              .eigenvalues()[n - 1]);
  if (most > gains.most_drive) drive_ *= gains.most_drive / most;
}

void ComputedTorque::operator()(const Eigen::VectorXd& q_d, const Eigen::VectorXd& dq_d,
                                const Eigen::VectorXd& ddq_d, const Eigen::VectorXd& q,
                                const Eigen::VectorXd& dq, double dt, Eigen::VectorXd& tau) noexcept {
  integral_ += dt * (q_d - q);
  const double w = dt > 0.0 ? gains_.bandwidth / dt : 0.0;  // [rad/s]
  feedback_ =
      w * w * (q_d - q) + 2.0 * gains_.damping * w * (dq_d - dq) + gains_.integral * w * w * w * integral_;
  reference_ = ddq_d + feedback_;
  inverse_dynamics(model_, ws_, q, dq, reference_, tau);
  for (Eigen::Index j = 0; j < tau.size(); ++j)
    tau[j] += rotor_[j] * reference_[j] + drive_[j] * feedback_[j] +
              friction_torque(friction_[static_cast<std::size_t>(j)], dq_d[j]);
}

}  // namespace dynid
