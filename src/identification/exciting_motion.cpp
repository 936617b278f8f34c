// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/exciting_motion.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "dynid/base/error.hpp"

namespace dynid {
namespace {

/// Series time and its derivatives at one instant.
struct Pace {
  double s, ds, dds, ddds;
};

/// `t` seconds into a start of `ramp` seconds.
Pace starting(double t, double ramp) {
  const double u = t / ramp;
  return {ramp * u * u * u * u * (2.5 + u * (-3.0 + u)), u * u * u * (10.0 + u * (-15.0 + 6.0 * u)),
          30.0 * u * u * (1.0 + u * (-2.0 + u)) / ramp,
          60.0 * u * (1.0 + u * (-3.0 + 2.0 * u)) / (ramp * ramp)};
}

Pace pace(const MotionShape& shape, double t) {
  t = std::clamp(t, 0.0, shape.duration);
  if (shape.kind == MotionKind::fourier) return {t, 1.0, 0.0, 0.0};
  if (t < shape.ramp) return starting(t, shape.ramp);
  const double left = shape.duration - t;
  if (left >= shape.ramp) return {t - 0.5 * shape.ramp, 1.0, 0.0, 0.0};
  const Pace end = starting(left, shape.ramp);
  return {shape.duration - shape.ramp - end.s, end.ds, -end.dds, end.ddds};
}

}  // namespace

void MotionShape::validate() const {
  if (harmonics < 1) throw Error("exciting motion: " + std::to_string(harmonics) + " harmonics");
  if (!(omega > 0.0) || !std::isfinite(omega))
    throw Error("exciting motion: the base frequency is not positive");
  if (!(duration > 0.0) || !std::isfinite(duration))
    throw Error("exciting motion: the duration is not positive");
  if (kind == MotionKind::ramped && !(ramp > 0.0 && 2.0 * ramp <= duration))
    throw Error("exciting motion: start and end of " + std::to_string(ramp) + " s each do not fit into " +
                std::to_string(duration) + " s");
}

MotionBasis::MotionBasis(const MotionShape& shape, const Eigen::VectorXd& t) {
  const int L = shape.harmonics;
  for (Eigen::MatrixXd* x : {&q, &dq, &ddq, &jerk}) x->resize(t.size(), 2 * L);
  for (Eigen::Index i = 0; i < t.size(); ++i) {
    const Pace p = pace(shape, t[i]);
    for (int l = 1; l <= L; ++l) {
      const double w = l * shape.omega, s = std::sin(w * p.s), c = std::cos(w * p.s);
      const double derivatives[2][4] = {{s / w, c, -w * s, -w * w * c}, {-c / w, s, w * c, -w * w * s}};
      for (int kind = 0; kind < 2; ++kind) {
        const double* d = derivatives[kind];
        const int column = kind * L + l - 1;
        q(i, column) = d[0];
        dq(i, column) = d[1] * p.ds;
        ddq(i, column) = d[2] * p.ds * p.ds + d[1] * p.dds;
        jerk(i, column) = d[3] * p.ds * p.ds * p.ds + 3.0 * d[2] * p.ds * p.dds + d[1] * p.ddds;
      }
    }
  }
}

Eigen::MatrixXd rest_projection(const MotionShape& shape) {
  const int columns = 2 * shape.harmonics;
  Eigen::MatrixXd projection = Eigen::MatrixXd::Identity(columns, columns);
  if (shape.kind == MotionKind::ramped) return projection;
  const MotionBasis ends(shape, Eigen::Vector2d(0.0, shape.duration));
  Eigen::MatrixXd conditions(4, columns);
  conditions << ends.dq, ends.ddq;
  conditions.rowwise().normalize();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(conditions, Eigen::ComputeThinV);
  // Ends that are one condition but for rounding leave singular values of 1e-13.
  for (Eigen::Index k = 0; k < svd.singularValues().size(); ++k)
    if (svd.singularValues()[k] > 1e-9) projection -= svd.matrixV().col(k) * svd.matrixV().col(k).transpose();
  return projection;
}

ExcitingMotion::ExcitingMotion(const MotionShape& shape, Eigen::MatrixXd coefficients, Eigen::VectorXd offset)
    : shape_(shape), coefficients_(std::move(coefficients)), offset_(std::move(offset)) {
  shape_.validate();
  if (coefficients_.rows() != 2 * shape_.harmonics || coefficients_.cols() != offset_.size())
    throw Error("exciting motion: " + std::to_string(coefficients_.rows()) + " x " +
                std::to_string(coefficients_.cols()) + " coefficients for " +
                std::to_string(shape_.harmonics) + " harmonics of " + std::to_string(offset_.size()) +
                " joints");
}

Trajectory ExcitingMotion::at(const Eigen::VectorXd& t, Eigen::MatrixXd* jerk) const {
  const MotionBasis basis(shape_, t);
  Trajectory out;
  out.source = "exciting motion";
  out.t = t;
  out.q = (basis.q * coefficients_).rowwise() + offset_.transpose();
  out.dq = basis.dq * coefficients_;
  out.ddq = basis.ddq * coefficients_;
  if (jerk != nullptr) *jerk = basis.jerk * coefficients_;
  return out;
}

Trajectory ExcitingMotion::sampled(double rate) const {
  if (!(rate > 0.0) || !std::isfinite(rate))
    throw Error("exciting motion: the sampling rate is not positive");
  const auto steps =
      std::max<Eigen::Index>(1, static_cast<Eigen::Index>(std::ceil(shape_.duration * rate - 1e-6)));
  Trajectory out = at(Eigen::VectorXd::LinSpaced(steps + 1, 0.0, shape_.duration));
  for (Eigen::MatrixXd* x : {&out.dq, &out.ddq}) {
    const double rounding = 1e-12 * (1.0 + x->cwiseAbs().maxCoeff());
    for (const Eigen::Index end : {Eigen::Index{0}, steps})
      for (double& value : x->row(end))
        if (std::abs(value) < rounding) value = 0.0;
  }
  return out;
}

}  // namespace dynid
