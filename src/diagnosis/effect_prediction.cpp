// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/effect_prediction.hpp"

#include <algorithm>

#include "dynid/base/error.hpp"
#include "dynid/diagnosis/gap_motion.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/effect/enter.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/signal/prepare.hpp"
#include "rows.hpp"

namespace dynid {

namespace {

/// All effects of the robot are functions of q, dq and ddq.
bool without_memory(const Robot& robot) {
  return std::all_of(robot.effects.begin(), robot.effects.end(),
                     [](const Effect& effect) { return effect_schema(effect.name).in_loop(); });
}

}  // namespace

Eigen::MatrixXd predict_effects(const Robot& given, const Log& log, double cutoff) {
  const int n = given.size();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(log.samples(), n);
  if (given.effects.empty()) return out;
  if (log.t.size() == 0) throw Error(log.source + ": column t is missing (the effects of the model need it)");
  const Robot robot = with_effects_entered(given, Entering::everything);
  if (robot.effects.size() < given.effects.size())
    out = predict_torque(robot, log, cutoff).tau - predict_torque(given, log, cutoff).tau;
  if (robot.effects.empty()) return out;
  if (log.dq.size() > 0 && log.ddq.size() > 0 && without_memory(robot)) {  // as it stands
    Segment segment;
    segment.t = log.t;
    segment.rate =
        log.samples() > 1 ? double(log.samples() - 1) / (log.t[log.samples() - 1] - log.t[0]) : 1.0;
    segment.q = log.q, segment.dq = log.dq, segment.ddq = log.ddq;
    segment.tau = Eigen::MatrixXd::Zero(log.samples(), n);
    return out + effect_torque(robot, GapMotion(robot, segment, log.t[0]));
  }
  Log motion = log;
  if (motion.tau.size() == 0) motion.tau = Eigen::MatrixXd::Zero(log.samples(), n);  // not asked for here
  PrepareOptions options;
  options.cutoff = cutoff;
  options.bridge_gaps = true;
  options.speed_cutoff = detail::speed_band;
  const PreparedLog prepared = prepare(motion, options);
  const Segment& segment = prepared.segments.front();
  const Eigen::MatrixXd torque = effect_torque(robot, GapMotion(robot, segment, segment.t[0]));
  for (int j = 0; j < n; ++j) out.col(j) += interpolate(segment.t, Eigen::VectorXd(torque.col(j)), log.t);
  return out;
}

}  // namespace dynid
