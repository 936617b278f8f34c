// SPDX-License-Identifier: Apache-2.0
#include "dynid/simulation/measurement.hpp"

#include <cmath>
#include <string>

#include "dynid/base/error.hpp"

namespace dynid {

MeasurementOptions MeasurementOptions::realistic(double noise) {
  MeasurementOptions options;
  options.encoder_resolution = 2.0 * M_PI / 1048576.0;
  options.velocity_cutoff = 100.0;
  options.white_noise = 0.05 * noise;
  options.correlated_noise = 0.03 * noise;
  options.stamp_jitter = 5e-5;
  options.repeat_probability = 0.005;
  return options;
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
  constexpr double reference_torque = 87.0;  // [N m], of the joint that the options speak of
  const int n = robot.size();
  scale_.setOnes(n);
  for (int j = 0; j < n; ++j) {
    const double limit = robot.joints[static_cast<std::size_t>(j)].limits.torque;
    if (std::isfinite(limit)) scale_[j] = std::sqrt(limit / reference_torque);
  }
  for (Eigen::VectorXd* v : {&q_, &dq_, &tau_, &slow_}) v->setZero(n);
  std::seed_seq sequence{seed, 0x6d65617375UL};
  random_.seed(sequence);
}

double Measurement::quantised(double q) const noexcept {
  const double quantum = options_.encoder_resolution;
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
  for (Eigen::Index j = 0; j < q.size(); ++j) q_[j] = quantised(q[j]);
  dq_ = dq;
  measure_torque(tau, 0.0);
}

void Measurement::update(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& tau,
                         double dt) {
  const double passed =
      options_.velocity_cutoff > 0.0 ? -std::expm1(-2.0 * M_PI * options_.velocity_cutoff * dt) : 1.0;
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const double now = quantised(q[j]);
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
