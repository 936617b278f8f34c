// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/measurement.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/joint_scale.hpp"

namespace dynid {

MeasurementOptions MeasurementOptions::realistic(double noise) {
  MeasurementOptions options;
  options.encoder_resolution = 2.0 * M_PI / 1048576.0;
  options.velocity_cutoff = 100.0;
  options.white_noise = noise / 1740.0;
  options.correlated_noise = noise / 2900.0;
  options.stamp_jitter = 5e-5;
  options.repeat_probability = 0.005;
  return options;
}

Eigen::VectorXd torque_ranges(const Robot& robot) {
  constexpr double rated = 3.0, believed = 10.0;  // times what is carried
  const std::vector<JointScale> scales = joint_scales(robot);
  const int n = robot.size();
  Eigen::VectorXd range(n);
  for (const bool slides : {false, true}) {
    double limit = 0.0, carried = 0.0;
    for (int j = 0; j < n; ++j) {
      const JointScale& s = scales[static_cast<std::size_t>(j)];
      if ((s.type == JointType::prismatic) != slides) continue;
      const double own = robot.joints[static_cast<std::size_t>(j)].limits.torque;
      if (std::isfinite(own)) limit = std::max(limit, own);
      carried = std::max(carried, s.torque);
    }
    const double factor = limit > believed * carried ? rated * carried / limit : 1.0;
    double largest = 0.0;
    for (int j = 0; j < n; ++j) {
      const JointScale& s = scales[static_cast<std::size_t>(j)];
      if ((s.type == JointType::prismatic) != slides) continue;
      const double own = robot.joints[static_cast<std::size_t>(j)].limits.torque;
      range[j] = std::isfinite(own) ? factor * own : rated * s.torque;
      largest = std::max(largest, range[j]);
    }
    for (int j = 0; j < n; ++j)
      if ((scales[static_cast<std::size_t>(j)].type == JointType::prismatic) == slides)
        range[j] = std::sqrt(range[j] * largest);
  }
  return range;
}

Measurement::Measurement(const Robot& robot, const MeasurementOptions& options, unsigned long seed)
    : options_(options) {
  const std::pair<const char*, double> all[] = {{"encoder_resolution", options.encoder_resolution},
                                                {"velocity_cutoff", options.velocity_cutoff},
                                                {"white_noise", options.white_noise},
                                                {"correlated_noise", options.correlated_noise},
                                                {"correlation_time", options.correlation_time},
                                                {"stamp_jitter", options.stamp_jitter},
                                                {"repeat_probability", options.repeat_probability}};
  for (const auto& [name, value] : all)
    if (!(value >= 0.0) || !std::isfinite(value))
      throw Error(std::string("measurement: ") + name + " must not be negative");
  if (!(options.correlation_time > 0.0)) throw Error("measurement: correlation_time must be positive");
  if (!(options.repeat_probability < 1.0)) throw Error("measurement: repeat_probability must be below 1");
  const int n = robot.size();
  scale_ = torque_ranges(robot);
  quantum_.setConstant(n, options.encoder_resolution);
  const std::vector<JointScale> scales = joint_scales(robot);
  for (int j = 0; j < n; ++j)
    if (const JointScale& s = scales[static_cast<std::size_t>(j)]; s.type == JointType::prismatic)
      quantum_[j] *= s.travel / (2.0 * M_PI);
  for (Eigen::VectorXd* v : {&q_, &dq_, &tau_, &slow_}) v->setZero(n);
  std::seed_seq sequence{seed, 0x6d65617375UL};
  random_.seed(sequence);
}

double Measurement::quantised(Eigen::Index joint, double q) const noexcept {
  const double quantum = quantum_[joint];
  return quantum > 0.0 ? std::nearbyint(q / quantum) * quantum : q;
}

void Measurement::measure_torque(const Eigen::VectorXd& tau, double forgetting) {
  tau_ = tau;
  if (options_.correlated_noise > 0.0) {
    const double fresh = options_.correlated_noise * std::sqrt(1.0 - forgetting * forgetting);
    for (Eigen::Index j = 0; j < tau.size(); ++j)
      slow_[j] = forgetting * slow_[j] + fresh * scale_[j] * normal_(random_);
    tau_ += slow_;
  }
  if (options_.white_noise > 0.0)
    for (Eigen::Index j = 0; j < tau.size(); ++j)
      tau_[j] += options_.white_noise * scale_[j] * normal_(random_);
}

void Measurement::reset(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& tau) {
  slow_.setZero();
  for (Eigen::Index j = 0; j < q.size(); ++j) q_[j] = quantised(j, q[j]);
  dq_ = dq;
  measure_torque(tau, 0.0);
}

void Measurement::update(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& tau,
                         double dt) {
  const double passed =
      options_.velocity_cutoff > 0.0 ? -std::expm1(-2.0 * M_PI * options_.velocity_cutoff * dt) : 1.0;
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const double now = quantised(j, q[j]);
    if (options_.velocity_cutoff > 0.0) {
      dq_[j] += passed * ((now - q_[j]) / dt - dq_[j]);
    } else {
      dq_[j] = dq[j];
    }
    q_[j] = now;
  }
  measure_torque(tau, std::exp(-dt / options_.correlation_time));
}

}  // namespace dynid
