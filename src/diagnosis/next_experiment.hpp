// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/diagnosis/diagnose.hpp"

namespace dynid::detail {

/// Step 12 of the method: of candidate motions, the one on which the two effects of every aliased pair differ
/// most, by the distinguishability D_ij = |(I - P_j) W Phi_i c|^2 / 2 of the pair that differs least
/// (Eriksson, Frisk, Krysander 2013).
NextExperiment next_experiment(const Robot& nominal, const Diagnosis& diagnosis);

}  // namespace dynid::detail
