// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/friction/fit.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/identification/identify.hpp"
#include "log_rows.hpp"

namespace dynid {

TwoStageFriction identify_friction(const Robot& robot, const std::vector<Log>& logs, FrictionLaw law,
                                   const IdentifyOptions& options) {
  if (logs.empty()) throw Error("friction identification: no log was given");
  const bool rotor = std::any_of(robot.joints.begin(), robot.joints.end(),
                                 [](const Joint& joint) { return joint.rotor_inertia != 0.0; });
  const BaseParameters base = base_parameters(robot, rotor);
  const Eigen::VectorXd x = base.K * parameter_vector(robot, base);
  double cutoff = 0.0;
  std::vector<PreparedLog> reports;
  const std::vector<RegressionRows> rows = detail::rows_of_logs(robot, base, logs, options, cutoff, reports);
  const int n = robot.size();

  TwoStageFriction out;
  out.robot = robot;
  out.before.rmse = out.after.rmse = Eigen::VectorXd::Zero(n);
  Eigen::Index total = 0;
  double energy = 0.0;
  for (const RegressionRows& r : rows) {
    total += r.size();
    energy += r.tau().squaredNorm();
  }
  for (int j = 0; j < n; ++j) {
    Eigen::VectorXd dq(total), difference(total);
    Eigen::Index first = 0;
    for (const RegressionRows& r : rows) {
      dq.segment(first, r.size()) = r.velocity(j);
      difference.segment(first, r.size()) = r.tau().col(j) - r.rigid(j) * x;
      first += r.size();
    }
    const FrictionChoice choice = choose_friction_law(dq, difference, options.velocity_scale);
    out.comparison.push_back({j + 1, choice.linear, choice.sigmoid, choice.law});
    JointFriction f;
    if (law == FrictionLaw::linear) f = fit_linear_friction(dq, difference, options.velocity_scale).friction;
    if (law == FrictionLaw::sigmoid) f = fit_sigmoid_friction(dq, difference).friction;
    out.robot.joints[static_cast<std::size_t>(j)].friction = f;
    out.before.rmse[j] = difference.norm();
    for (Eigen::Index i = 0; i < total; ++i) difference[i] -= friction_torque(f, dq[i]);
    out.after.rmse[j] = difference.norm();
  }
  for (FitQuality* q : {&out.before, &out.after}) {
    q->rows = total;
    q->relative_error_percent = 100.0 * q->rmse.norm() / std::sqrt(energy);
    q->rmse /= std::sqrt(double(total));
  }
  out.before.source = "without friction";
  out.after.source = "with friction";
  return out;
}

}  // namespace dynid
