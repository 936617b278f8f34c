// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/identification/predict.hpp"
#include "dynid/signal/table.hpp"

namespace dynid::detail {

/// Columns t, tau1.., tauf1...
Table torque_table(const PredictedTorque& predicted);

}  // namespace dynid::detail
