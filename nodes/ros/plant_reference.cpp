// SPDX-License-Identifier: Apache-2.0
#include "ros/plant_reference.hpp"

#include <algorithm>
#include <utility>

namespace dynid {
namespace {

/// From 0 to 1 over u in 0..1 with two derivatives that vanish at the ends: 10 u^3 - 15 u^4 + 6 u^5.
struct SmoothStep {
  double value, slope, curvature;
  explicit SmoothStep(double u)
      : value(u * u * u * (10.0 + u * (-15.0 + 6.0 * u))),
        slope(30.0 * u * u * (1.0 - u) * (1.0 - u)),
        curvature(60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)) {}
};

}  // namespace

PlantReference::PlantReference(const Eigen::VectorXd& held)
    : held_(held), offset_(Eigen::VectorXd::Zero(held.size())) {}

void PlantReference::begin(Trajectory& motion, double start) noexcept {
  std::swap(motion_, motion);
  offset_ = held_ - motion_.q.row(0).transpose();
  start_ = start;
  end_ = motion_.t[motion_.samples() - 1];
  if (!offset_.isZero(0.0)) end_ = std::max(end_, blending);
  moving_ = true;
  stopped_ = false;
}

void PlantReference::stop(double t) noexcept {
  if (!moving_ || stopped_) return;
  stop_ = t;
  if (t <= start_) {
    moving_ = false;
  } else {
    stopped_ = true;
  }
}

void PlantReference::at(double t, Eigen::VectorXd& q, Eigen::VectorXd& dq, Eigen::VectorXd& ddq) noexcept {
  if (!moving_ || t < start_) {
    q = held_;
    dq.setZero();
    ddq.setZero();
    return;
  }
  // Time along the path, which a stop slows down to nothing.
  double s = t - start_, rate = 1.0, braking = 0.0;
  bool over = false;
  if (stopped_) {
    const double u = std::min(1.0, (t - stop_) / stopping);
    const SmoothStep step(u);
    s = stop_ - start_ + stopping * (u + u * u * u * u * (-2.5 + u * (3.0 - u)));
    rate = 1.0 - step.value;
    braking = -step.slope / stopping;
    over = u >= 1.0;
  }
  over = over || s >= end_;
  s = std::min(s, end_);
  sample(motion_, s, q, dq, ddq);
  if (s < blending) {
    const SmoothStep step(s / blending);
    q += (1.0 - step.value) * offset_;
    dq -= (step.slope / blending) * offset_;
    ddq -= (step.curvature / (blending * blending)) * offset_;
  }
  ddq = rate * rate * ddq + braking * dq;
  dq *= rate;
  if (!over) return;
  held_ = q;
  dq.setZero();
  ddq.setZero();
  moving_ = false;
}

}  // namespace dynid
