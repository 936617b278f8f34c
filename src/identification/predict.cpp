// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/predict.hpp"

#include <string>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/model.hpp"
#include "dynid/dynamics/workspace.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {

PredictedTorque predict_torque(const Robot& robot, const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                               const Eigen::MatrixXd& ddq) {
  const int n = robot.size();
  for (const Eigen::MatrixXd* x : {&q, &dq, &ddq})
    if (x->cols() != n || x->rows() != q.rows())
      throw Error("torque prediction: a motion of " + std::to_string(x->rows()) + " x " +
                  std::to_string(x->cols()) + " for " + std::to_string(q.rows()) + " samples of " +
                  std::to_string(n) + " joints");
  const Model<> model(robot);
  Workspace<> workspace(model);
  PredictedTorque out;
  out.t = Eigen::VectorXd::LinSpaced(q.rows(), 0.0, double(q.rows() - 1));
  out.tau.resize(q.rows(), n);
  out.tau_f.resize(q.rows(), n);
  Eigen::VectorXd qi(n), dqi(n), ddqi(n), tau(n);
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    qi = q.row(i);
    dqi = dq.row(i);
    ddqi = ddq.row(i);
    inverse_dynamics(model, workspace, qi, dqi, ddqi, tau);
    for (int j = 0; j < n; ++j) {
      const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
      out.tau_f(i, j) = friction_torque(joint.friction, dqi[j]);
      out.tau(i, j) = tau[j] + joint.rotor_inertia * ddqi[j] + out.tau_f(i, j);
    }
  }
  return out;
}

PredictedTorque predict_torque(const Robot& robot, const Log& log, double cutoff) {
  const int n = robot.size();
  if (log.ddq.size() > 0) {
    if (log.dq.size() == 0) throw Error(log.source + ": column dq1 is missing");
    PredictedTorque out = predict_torque(robot, log.q, log.dq, log.ddq);
    if (log.t.size() > 0) out.t = log.t;
    return out;
  }
  Log motion = log;
  if (motion.tau.size() == 0) motion.tau = Eigen::MatrixXd::Zero(log.samples(), n);  // not asked for here
  PrepareOptions options;
  options.cutoff = cutoff;
  options.bridge_gaps = true;
  options.thin = false;
  const PreparedLog prepared = prepare(motion, options);
  const Segment& s = prepared.segments.front();
  Eigen::MatrixXd q(log.samples(), n), dq(log.samples(), n), ddq(log.samples(), n);
  for (int j = 0; j < n; ++j) {
    q.col(j) = interpolate(s.t, s.q.col(j), log.t);
    dq.col(j) = interpolate(s.t, s.dq.col(j), log.t);
    ddq.col(j) = interpolate(s.t, s.ddq.col(j), log.t);
  }
  PredictedTorque out = predict_torque(robot, q, dq, ddq);
  out.t = log.t;
  return out;
}

}  // namespace dynid
