// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>

#include "dynid/app/context.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {

/// The torques that a model, its effects included, predicts along a recorded motion.
struct TorqueJob {
  Robot robot;
  Log log;  ///< with t, or with ddq, which is then taken as it stands; tau is compared where it is
  double cutoff = 0.0;  ///< [Hz] of the zero-phase low-pass filter of the motion; 0: chosen
};

struct TorqueReport {
  std::string robot;  ///< its name
  PredictedTorque predicted;
  Eigen::VectorXd rms_difference;  ///< n [N m] to the log's own tau, unfiltered; empty where it has none

  Eigen::Index samples() const noexcept { return predicted.tau.rows(); }
  Table table() const;  ///< t, tau1.., tauf1..
};

/// What a log must have for a TorqueJob: q alone.
LogColumns torque_columns();

/// Throws OptionError: `cutoff` must not be negative. Does not look at robot and log.
void check_options(const TorqueJob& job);

/// Allocates. Throws OptionError, Error as predict_torque() and predict_effects(), and naming the log where
/// it has neither t nor ddq, Stopped.
TorqueReport run(const TorqueJob& job, const Context& context = {});

}  // namespace dynid
