// SPDX-License-Identifier: Apache-2.0
#include "servo_load_parts.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "dynid/dynamics/regressor.hpp"
#include "dynid/model/link_inertia.hpp"
#include "dynid/signal/filter.hpp"

namespace dynid::detail {
namespace {

/// Directions in which the parameters of a link may be off, each by one standard deviation: a relative
/// change of the root of the pseudo-inertia, which any body has.
Eigen::Matrix<double, 10, 10> directions_of(const StandardParameters& link, double tolerance) {
  Eigen::Matrix<double, 10, 10> out = Eigen::Matrix<double, 10, 10>::Zero();
  const Eigen::LLT<Eigen::Matrix4d> factor(pseudo_inertia(link));
  if (factor.info() != Eigen::Success) {
    out.col(0) = tolerance * link;
    return out;
  }
  const Eigen::Matrix4d L = factor.matrixL();
  Eigen::Index k = 0;
  for (Eigen::Index r = 0; r < 4; ++r)
    for (Eigen::Index c = 0; c <= r; ++c) {
      Eigen::Matrix4d S = Eigen::Matrix4d::Zero();
      S(r, c) = S(c, r) = r == c ? tolerance : tolerance / std::sqrt(2.0);
      out.col(k++) = from_pseudo_inertia(L * S * L.transpose());
    }
  return out;
}

}  // namespace

void add_load_parts(const Robot& nominal, const std::vector<Log>& logs, double tolerance,
                    std::vector<std::vector<ServoSeries>>& series) {
  constexpr Eigen::Index enough = 1000;  // rows of a log that show its shapes
  const Eigen::Index n = nominal.size();
  if (tolerance <= 0.0) return;
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(10 * n, 10 * n);
  for (Eigen::Index j = 0; j < n; ++j)
    directions.block<10, 10>(10 * j, 10 * j) =
        directions_of(nominal.joints[static_cast<std::size_t>(j)].parameters, tolerance);
  const Model<> model(nominal);
  std::vector<SmoothMotion> motions;
  for (std::size_t l = 0; l < logs.size(); ++l)
    motions.push_back(smooth_motion(logs[l], series.front()[l].interval));
  // Row `i` of a motion: what a unit of each direction adds to each joint's torque.
  const auto torques = [&](Workspace<>& ws, const SmoothMotion& m, Eigen::Index i, Eigen::MatrixXd& Y) {
    regressor(model, ws, m.q.row(i).transpose(), m.v.row(i).transpose(), m.a.row(i).transpose(), Y);
  };
  std::vector<Eigen::MatrixXd> squares(static_cast<std::size_t>(n), Eigen::MatrixXd::Zero(10 * n, 10 * n));
  Workspace<> ws(model);
  Eigen::MatrixXd Y(n, 10 * n);
  Eigen::Index rows = 0;
  for (const SmoothMotion& m : motions) {
    const Eigen::Index stride = std::max<Eigen::Index>(1, m.t.size() / enough);
    for (Eigen::Index i = 0; i < m.t.size(); i += stride, ++rows) {
      torques(ws, m, i, Y);
      for (Eigen::Index j = 0; j < n; ++j)
        squares[static_cast<std::size_t>(j)].selfadjointView<Eigen::Lower>().rankUpdate(Y.row(j).transpose());
    }
  }
  std::vector<Eigen::MatrixXd> shapes(static_cast<std::size_t>(n));  // parameters of each part
  for (std::size_t j = 0; j < shapes.size(); ++j) {
    const Eigen::MatrixXd whole = squares[j].selfadjointView<Eigen::Lower>();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(directions.transpose() * whole * directions);
    shapes[j] = directions * eigen.eigenvectors().rightCols(servo_load_parts).rowwise().reverse();
  }
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const SmoothMotion& m = motions[l];
    std::vector<Eigen::MatrixXd> parts(shapes.size(), Eigen::MatrixXd(m.t.size(), servo_load_parts));
    for (Eigen::Index i = 0; i < m.t.size(); ++i) {
      torques(ws, m, i, Y);
      for (std::size_t j = 0; j < shapes.size(); ++j)
        parts[j].row(i) = Y.row(static_cast<Eigen::Index>(j)) * shapes[j];
    }
    for (std::size_t j = 0; j < shapes.size(); ++j) {
      ServoSeries& s = series[j][l];
      if (s.load.size() == 0) continue;
      s.parts.resize(s.t.size(), servo_load_parts);
      for (Eigen::Index k = 0; k < servo_load_parts; ++k)
        s.parts.col(k) = interpolate(m.t, parts[j].col(k), logs[l].t);
    }
  }
}

}  // namespace dynid::detail
