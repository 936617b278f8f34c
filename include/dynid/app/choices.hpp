// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "dynid/app/export.hpp"
#include "dynid/app/init.hpp"
#include "dynid/diagnosis/blind.hpp"
#include "dynid/identification/excite.hpp"
#include "dynid/identification/identify.hpp"

namespace dynid {

/// The words for the values of an option, as people write them on a command line or as a parameter, and as
/// they stand in the JSON.
template <class T>
using Choices = std::map<std::string, T>;

const Choices<FrictionLaw>& friction_laws();                ///< none, linear, sigmoid
const Choices<Method>& methods();                           ///< ols, wls, irls
const Choices<MotionSource>& motion_sources();              ///< auto, velocity, position
const Choices<MotionKind>& motion_kinds();                  ///< fourier, ramped
const Choices<ExcitationCriterion>& excitation_criteria();  ///< condition, determinant
const Choices<BlindKind>& blind_kinds();                    ///< clean, nominal, weak, mixed
const Choices<DhConvention>& dh_conventions();              ///< modified, standard
const Choices<ExportFormat>& export_formats();              ///< urdf, mjcf, sdf, yaml, header, franka

/// The word for a value; empty where there is none.
template <class T>
std::string word_for(const Choices<T>& choices, T value) {
  for (const auto& [word, choice] : choices)
    if (choice == value) return word;
  return {};
}

}  // namespace dynid
