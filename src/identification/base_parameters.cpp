// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/base_parameters.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/regressor.hpp"
#include "dynid/dynamics/workspace.hpp"

namespace dynid {
namespace {

/// The triangular factor of the regressor at random states: its row space is all that any motion can show.
Eigen::MatrixXd structural_factor(const Robot& robot, bool rotor_inertia) {
  const int n = robot.size(), standard = 10 * n, P = standard + (rotor_inertia ? n : 0);
  const Model<> model(robot);
  Workspace<> workspace(model);
  std::mt19937_64 random(1);
  const auto uniform = [&](double scale) { return scale * (2.0 * double(random() >> 11) * 0x1.0p-53 - 1.0); };
  const int states = 4 * P / n + 8;
  Eigen::MatrixXd stack = Eigen::MatrixXd::Zero(states * n, P);
  Eigen::MatrixXd Y(n, standard);
  Eigen::VectorXd q(n), dq(n), ddq(n);
  for (int s = 0; s < states; ++s) {
    for (int j = 0; j < n; ++j) {
      q[j] = uniform(robot.joints[static_cast<std::size_t>(j)].type == JointType::prismatic ? 1.0 : M_PI);
      dq[j] = uniform(2.0);
      ddq[j] = uniform(4.0);
    }
    regressor(model, workspace, q, dq, ddq, Y);
    stack.block(s * n, 0, n, standard) = Y;
    if (rotor_inertia) stack.block(s * n, standard, n, n) = ddq.asDiagonal();
  }
  return Eigen::HouseholderQR<Eigen::MatrixXd>(stack).matrixQR().topRows(P).triangularView<Eigen::Upper>();
}

std::string in_words(const Eigen::RowVectorXd& row, int joints) {
  struct Term {
    int kind, link, index;
  };
  std::vector<Term> terms;
  for (int k = 0; k < row.size(); ++k) {
    if (row[k] == 0.0) continue;
    const bool rotor = k >= 10 * joints;
    terms.push_back({rotor ? 10 : k % 10, rotor ? k - 10 * joints : k / 10, k});
  }
  std::sort(terms.begin(), terms.end(), [](const Term& a, const Term& b) {
    return a.kind != b.kind ? a.kind < b.kind : a.link < b.link;
  });
  std::string text;
  for (const Term& term : terms) {
    const double factor = row[term.index];
    text += text.empty() ? (factor < 0.0 ? "-" : "") : (factor < 0.0 ? " - " : " + ");
    if (std::abs(std::abs(factor) - 1.0) > 1e-9) text += short_number(std::abs(factor)) + " ";
    text += parameter_name(term.index, joints);
  }
  return text;
}

}  // namespace

int BaseParameters::rigid() const noexcept {
  return static_cast<int>(std::count_if(columns.begin(), columns.end(), [&](int k) { return k < standard; }));
}

std::string parameter_name(int k, int joints) {
  if (k >= 10 * joints) return "ia" + std::to_string(k - 10 * joints + 1);
  return standard_parameter_names[static_cast<std::size_t>(k % 10)] + std::to_string(k / 10 + 1);
}

BaseParameters base_parameters(const Robot& robot, bool rotor_inertia) {
  constexpr double tolerance = 1e-7;
  validate(robot);
  const Eigen::MatrixXd R = structural_factor(robot, rotor_inertia);
  const int n = robot.size();
  const auto P = static_cast<int>(R.cols());

  BaseParameters base;
  base.standard = 10 * n;
  base.rotor_inertia = rotor_inertia;
  // Gram-Schmidt, left to right, each column orthogonalised twice: the remainder of a dependent column is
  // rounding.
  Eigen::MatrixXd Q(P, 0);
  const double scale = R.colwise().norm().maxCoeff();
  for (int k = 0; k < P; ++k) {
    Eigen::VectorXd v = R.col(k);
    const double norm = v.norm();
    for (int pass = 0; pass < 2; ++pass) v -= Q * (Q.transpose() * v);
    if (v.norm() <= tolerance * std::max(norm, 1e-3 * scale)) continue;
    Q.conservativeResize(Eigen::NoChange, Q.cols() + 1);
    Q.rightCols<1>() = v.normalized();
    base.columns.push_back(k);
  }
  const int r = base.size();
  if (r == 0) throw Error("robot '" + robot.name + "': no parameter has any influence on the torques");

  // R = R(:, columns) K: exact for every column, the independent ones giving the identity.
  const Eigen::MatrixXd triangle = Q.transpose() * R(Eigen::all, base.columns);
  base.K = triangle.triangularView<Eigen::Upper>().solve(Q.transpose() * R);
  for (int i = 0; i < r; ++i) {
    for (int k = 0; k < P; ++k)
      if (std::abs(base.K(i, k)) < 1e-7) base.K(i, k) = 0.0;  // rounding, not geometry
    for (int c = 0; c < r; ++c) base.K(i, base.columns[static_cast<std::size_t>(c)]) = c == i ? 1.0 : 0.0;
    base.names.push_back(parameter_name(base.columns[static_cast<std::size_t>(i)], n));
    base.expressions.push_back(in_words(base.K.row(i), n));
  }
  return base;
}

Eigen::VectorXd parameter_vector(const Robot& robot, const BaseParameters& base) {
  Eigen::VectorXd pi(base.parameters());
  pi.head(base.standard) = robot.parameters();
  if (base.rotor_inertia)
    for (int j = 0; j < robot.size(); ++j)
      pi[base.standard + j] = robot.joints[static_cast<std::size_t>(j)].rotor_inertia;
  return pi;
}

Eigen::VectorXd nearest_parameters(const BaseParameters& base, const Eigen::VectorXd& coefficients,
                                   const Eigen::VectorXd& start) {
  const Eigen::VectorXd missing = coefficients - base.K * start;
  return start + base.K.transpose() * (base.K * base.K.transpose()).ldlt().solve(missing);
}

Eigen::VectorXd leading_parameters(const BaseParameters& base, const Eigen::VectorXd& coefficients) {
  Eigen::VectorXd pi = Eigen::VectorXd::Zero(base.parameters());
  for (int i = 0; i < base.size(); ++i) pi[base.columns[static_cast<std::size_t>(i)]] = coefficients[i];
  return pi;
}

}  // namespace dynid
