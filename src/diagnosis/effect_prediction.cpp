// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/effect_prediction.hpp"

#include "dynid/base/error.hpp"
#include "dynid/diagnosis/gap_motion.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/signal/prepare.hpp"
#include "rows.hpp"

namespace dynid {

Eigen::MatrixXd predict_effects(const Robot& robot, const Log& log, double cutoff) {
  const int n = robot.size();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(log.samples(), n);
  if (robot.effects.empty()) return out;
  if (log.t.size() == 0) throw Error(log.source + ": column t is missing (the effects of the model need it)");
  Log motion = log;
  if (motion.tau.size() == 0) motion.tau = Eigen::MatrixXd::Zero(log.samples(), n);  // not asked for here
  PrepareOptions options;
  options.cutoff = cutoff;
  options.bridge_gaps = true;
  options.speed_cutoff = detail::speed_band;
  const PreparedLog prepared = prepare(motion, options);
  const GapMotion along(robot, prepared.segments.front(), prepared.segments.front().t[0]);
  const Eigen::MatrixXd torque = effect_torque(robot, along);
  for (int j = 0; j < n; ++j)
    out.col(j) = interpolate(prepared.segments.front().t, Eigen::VectorXd(torque.col(j)), log.t);
  return out;
}

}  // namespace dynid
