// SPDX-License-Identifier: Apache-2.0
#include "servo_payload.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "dynid/dynamics/joint_scale.hpp"
#include "identification/servo_run.hpp"

namespace dynid::detail {
namespace {

void add_scaled(ServoSeries& to, const ServoSeries& column, double factor, Eigen::Index first) {
  const Eigen::Index n = to.q.size();
  to.load += factor * column.load.segment(first, n);
  to.inertia += factor * column.inertia.segment(first, n);
  to.gravity += factor * column.gravity.segment(first, n);
}

Eigen::Map<const Eigen::VectorXd> column(const std::vector<double>& x) {
  return {x.data(), static_cast<Eigen::Index>(x.size())};
}

}  // namespace

StandardParameters ServoPayload::parameters() const {
  LinkInertia point;
  point.mass = value[0];
  if (value[0] > 0.0) point.com = value.tail<3>() / value[0];
  return to_standard(point);
}

PayloadLoads::PayloadLoads(const Robot& nominal, const std::vector<Log>& logs) {
  for (int k = 0; k < 10; ++k) {
    Robot unit = nominal;
    for (Joint& joint : unit.joints) {
      joint.parameters.setZero();
      joint.friction = {};
      joint.rotor_inertia = 0.0;
    }
    unit.joints.back().parameters[k] = 1.0;
    columns_.push_back(servo_series(logs, unit));
  }
}

void PayloadLoads::add(const ServoPayload& payload, int joint, ServoProblemOfJoint& problem) const {
  const StandardParameters p = payload.parameters();
  for (ServoRows& rows : problem.rows)
    for (std::size_t k = 0; k < columns_.size(); ++k)
      add_scaled(rows.series,
                 columns_[k][static_cast<std::size_t>(joint)][static_cast<std::size_t>(rows.series.log)],
                 p[static_cast<Eigen::Index>(k)], rows.first);
}

ServoPayload fit_payload(const Robot& nominal, const PayloadLoads& loads,
                         const std::vector<ServoProblemOfJoint>& joints, const std::vector<KnobFit>& fits,
                         const std::vector<double>& samples, const ServoPayload& start) {
  constexpr int most_steps = 8;
  constexpr double probe = 1e-3;  // of the arm's mass
  double mass = 0.0;
  for (const Joint& joint : nominal.joints) mass += std::max(0.0, joint.parameters[0]);
  ServoPayload out = start;
  out.present = false;
  if (!(mass > 0.0)) return out;
  const double reach = arm_reach(nominal);
  const Eigen::Vector4d size(mass, mass * reach, mass * reach, mass * reach);
  // Losses of the joints that know their stiffness, with a payload.
  const auto residuals = [&](const ServoPayload& payload, const std::vector<KnobFit>& knobs) {
    std::vector<std::vector<double>> r(joints.size());
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (!(joints[j].nominal[at(Knob::load_gain)] > 0.0)) continue;
      ServoProblemOfJoint p = joints[j];
      loads.add(payload, static_cast<int>(j), p);
      for (const ServoRows& rows : p.rows) {
        const Eigen::VectorXd q = servo_motion(p, knobs[j].x, rows);
        for (Eigen::Index i = 1; i < q.size(); ++i)
          if (rows.fit[static_cast<std::size_t>(i)]) r[j].push_back(rows.series.q[i] - q[i]);
      }
    }
    return r;
  };
  // Log evidence, joints by their own independent samples, Huber's loss at the width of each.
  const auto evidence = [&](const std::vector<std::vector<double>>& r) {
    double sum = 0.0;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (r[j].empty()) continue;
      const double width = fits[j].width;
      double loss = 0.0;
      for (const double e : r[j]) loss += huber(e, width);
      loss /= double(r[j].size());
      sum -= 0.5 * samples[j] * std::log(2.0 * loss + joints[j].floor * joints[j].floor);
    }
    return sum;
  };
  // Of the residuals by the payload, joint by joint: rows x 4, in parts of `size`.
  const auto slopes = [&](const ServoPayload& payload, const std::vector<KnobFit>& knobs,
                          const std::vector<std::vector<double>>& r) {
    std::vector<Eigen::MatrixXd> J;
    for (const std::vector<double>& of_joint : r) J.emplace_back(of_joint.size(), 4);
    for (int k = 0; k < 4; ++k) {
      ServoPayload other = payload;
      other.value[k] += probe * size[k];
      if (other.value[0] <= 0.0) other.value[0] = probe * size[0];
      const std::vector<std::vector<double>> moved = residuals(other, knobs);
      for (std::size_t j = 0; j < r.size(); ++j) J[j].col(k) = (column(r[j]) - column(moved[j])) / probe;
    }
    return J;
  };
  // Evidence a row and a squared residual: independent samples over what is left.
  const auto weight_of = [&](std::size_t j, const std::vector<double>& r) {
    const double width = fits[j].width, count = double(r.size());
    double energy = 0.0;
    for (const double e : r) energy += std::min(e * e, width * width);
    return samples[j] / count / (energy / count + joints[j].floor * joints[j].floor);
  };
  // Of the residuals by the nominal parameters that stand beside a payload, joint by joint, each by one
  // standard deviation; and where they stand, in those.
  std::vector<Knob> beside = {Knob::kp, Knob::inertia, Knob::damping, Knob::coulomb, Knob::load_gain};
  for (int k = 0; k < servo_load_parts; ++k) beside.push_back(load_part(k));
  const auto others = static_cast<Eigen::Index>(beside.size());
  const auto deviation = [&](std::size_t j, Knob k) { return nominal_deviation(joints[j], k); };
  const auto nominal_slopes = [&](const ServoPayload& payload, const std::vector<KnobFit>& knobs,
                                  const std::vector<std::vector<double>>& r) {
    std::vector<Eigen::MatrixXd> J;
    for (const std::vector<double>& of_joint : r) J.emplace_back(of_joint.size(), others);
    for (Eigen::Index k = 0; k < others; ++k) {
      std::vector<KnobFit> shifted = knobs;
      const Knob knob = beside[static_cast<std::size_t>(k)];
      for (std::size_t j = 0; j < joints.size(); ++j) shifted[j].x[at(knob)] += deviation(j, knob);
      const std::vector<std::vector<double>> moved = residuals(payload, shifted);
      for (std::size_t j = 0; j < r.size(); ++j) J[j].col(k) = column(r[j]) - column(moved[j]);
    }
    return J;
  };
  const auto standing = [&](std::size_t j, const KnobFit& fit) {
    Eigen::VectorXd z = Eigen::VectorXd::Zero(others);
    for (Eigen::Index k = 0; k < others; ++k) {
      const Knob knob = beside[static_cast<std::size_t>(k)];
      if (const double one = deviation(j, knob); one > 0.0)
        z[k] = (fit.x[at(knob)] - joints[j].nominal[at(knob)]) / one;
    }
    return z;
  };
  const auto penalty = [&](const std::vector<KnobFit>& knobs) {
    double sum = 0.0;
    for (std::size_t j = 0; j < joints.size(); ++j) sum += 0.5 * standing(j, knobs[j]).squaredNorm();
    return sum;
  };
  const double before = evidence(residuals({}, fits)) - penalty(fits);
  std::vector<KnobFit> knobs = fits;
  std::vector<std::vector<double>> r = residuals(out, knobs);
  double now = evidence(r) - penalty(knobs);
  // A payload and the nominal's own errors in one step: by turns each would keep what the other took.
  for (int step = 0; step < most_steps; ++step) {
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    Eigen::Vector4d b = Eigen::Vector4d::Zero();
    const std::vector<Eigen::MatrixXd> J = slopes(out, knobs, r), N = nominal_slopes(out, knobs, r);
    std::vector<Eigen::MatrixXd> cross(joints.size()), own(joints.size());
    std::vector<Eigen::VectorXd> right(joints.size());
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (r[j].empty()) continue;
      const Eigen::VectorXd robust =
          weight_of(j, r[j]) * (fits[j].width / column(r[j]).cwiseAbs().array().max(fits[j].width)).matrix();
      own[j] = N[j].transpose() * robust.asDiagonal() * N[j];
      own[j].diagonal().array() += 1.0;
      cross[j] = J[j].transpose() * robust.asDiagonal() * N[j];
      right[j] = N[j].transpose() * robust.cwiseProduct(column(r[j])) - standing(j, knobs[j]);
      const Eigen::MatrixXd eliminated = own[j].ldlt().solve(cross[j].transpose());
      A += J[j].transpose() * robust.asDiagonal() * J[j] - cross[j] * eliminated;
      b += J[j].transpose() * robust.cwiseProduct(column(r[j])) - eliminated.transpose() * right[j];
    }
    A.diagonal().array() += 1e-6 * A.diagonal().maxCoeff() + 1e-300;
    const Eigen::Vector4d change = A.ldlt().solve(b);
    bool better = false;
    for (double part = 1.0; part > 0.05 && !better; part *= 0.5) {
      ServoPayload next = out;
      next.value += part * change.cwiseProduct(size);
      next.value[0] = std::max(next.value[0], probe * size[0]);
      std::vector<KnobFit> there_knobs = knobs;
      for (std::size_t j = 0; j < joints.size(); ++j) {
        if (r[j].empty()) continue;
        const Eigen::VectorXd z = own[j].ldlt().solve(right[j] - cross[j].transpose() * change);
        for (Eigen::Index k = 0; k < others; ++k) {
          const Knob knob = beside[static_cast<std::size_t>(k)];
          double& x = there_knobs[j].x[at(knob)];
          const double moved = x + part * z[k] * deviation(j, knob);
          if (moved > 0.0 || is_load_part(knob)) x = moved;
        }
      }
      const auto there = residuals(next, there_knobs);
      const double value = evidence(there) - penalty(there_knobs);
      if (value > now) {
        better = value > now + 1e-3;
        out.value = next.value;
        knobs = there_knobs;
        r = there;
        now = value;
        if (!better) break;
      }
    }
    if (!better) break;
  }
  // What a payload of other values does, less what the nominal's own errors would make of it, joint by joint.
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  const std::vector<Eigen::MatrixXd> of_payload = slopes(out, knobs, r),
                                     nominal_off = nominal_slopes(out, knobs, r);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (r[j].empty()) continue;
    const auto rows = static_cast<Eigen::Index>(r[j].size());
    Eigen::MatrixXd J(rows, 4 + others);
    J << of_payload[j], nominal_off[j];
    Eigen::MatrixXd H = weight_of(j, r[j]) * J.transpose() * J;
    H.bottomRightCorner(others, others).diagonal().array() += 1.0;
    information += H.topLeftCorner<4, 4>() -
                   H.topRightCorner(4, others) *
                       H.bottomRightCorner(others, others).ldlt().solve(H.bottomLeftCorner(others, 4));
  }
  double most = 0.0;
  for (const double s : samples) most = std::max(most, s);
  out.gain = now - before - 2.0 * std::log(most) - std::log(double(servo_effects().size()));
  information.diagonal().array() += 1e-9 * information.diagonal().maxCoeff() + 1e-300;
  out.covariance =
      size.asDiagonal() * information.ldlt().solve(Eigen::Matrix4d::Identity()) * size.asDiagonal();
  // A payload is weighed against the arm's own bodies, whose scale is known to within the tolerance.
  double tolerance = 0.0;
  for (const ServoProblemOfJoint& joint : joints) tolerance = std::max(tolerance, joint.tolerance);
  out.covariance += tolerance * tolerance * out.value * out.value.transpose();
  // And its place against where their masses are, by half of that as a root's error is of its square.
  out.covariance.bottomRightCorner<3, 3>().diagonal().array() +=
      0.25 * tolerance * tolerance * out.value.tail<3>().squaredNorm();
  // A body has mass, and is within what an arm can hold.
  out.present =
      out.value[0] > 2.0 * probe * size[0] && out.value.tail<3>().norm() < 2.0 * reach * out.value[0];
  return out;
}

}  // namespace dynid::detail
