// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dynid/model/robot.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// What a log must have to be diagnosed with this model: where it has servos, commands do for torques.
LogColumns diagnosis_columns(const Robot& nominal);

/// The logs have commands and no torques, and the model has servos: what is compared is the motion, and
/// run(DiagnoseJob) answers by diagnose_servos(). Throws Error where there are neither torques nor commands,
/// or no servos beside commands.
bool is_servo_diagnosis(const Robot& nominal, const std::vector<Log>& logs);

}  // namespace dynid
