// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/app/blind.hpp"

namespace dynid {

/// run(BlindJob) on servo logs: run_servo_blind(). Throws as that does; OptionError, Stopped.
BlindReport run_servos(const BlindJob& job, const Context& context = {});

}  // namespace dynid
