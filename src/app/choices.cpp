// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/choices.hpp"

namespace dynid {

const Choices<FrictionLaw>& friction_laws() {
  static const Choices<FrictionLaw> choices = {
      {"none", FrictionLaw::none}, {"linear", FrictionLaw::linear}, {"sigmoid", FrictionLaw::sigmoid}};
  return choices;
}

const Choices<Method>& methods() {
  static const Choices<Method> choices = {{"ols", Method::ols}, {"wls", Method::wls}, {"irls", Method::irls}};
  return choices;
}

const Choices<MotionSource>& motion_sources() {
  static const Choices<MotionSource> choices = {{"auto", MotionSource::automatic},
                                                {"velocity", MotionSource::velocity},
                                                {"position", MotionSource::position}};
  return choices;
}

const Choices<MotionKind>& motion_kinds() {
  static const Choices<MotionKind> choices = {{"fourier", MotionKind::fourier},
                                              {"ramped", MotionKind::ramped}};
  return choices;
}

const Choices<ExcitationCriterion>& excitation_criteria() {
  static const Choices<ExcitationCriterion> choices = {{"condition", ExcitationCriterion::condition},
                                                       {"determinant", ExcitationCriterion::determinant}};
  return choices;
}

const Choices<BlindKind>& blind_kinds() {
  static const Choices<BlindKind> choices = {{"clean", BlindKind::clean},
                                             {"nominal", BlindKind::nominal},
                                             {"weak", BlindKind::weak},
                                             {"vendor", BlindKind::vendor},
                                             {"mixed", BlindKind::mixed}};
  return choices;
}

const Choices<DhConvention>& dh_conventions() {
  static const Choices<DhConvention> choices = {{"modified", DhConvention::modified},
                                                {"standard", DhConvention::standard}};
  return choices;
}

const Choices<ExportFormat>& export_formats() {
  static const Choices<ExportFormat> choices = {
      {"urdf", ExportFormat::urdf}, {"mjcf", ExportFormat::mjcf},     {"sdf", ExportFormat::sdf},
      {"yaml", ExportFormat::yaml}, {"header", ExportFormat::header}, {"franka", ExportFormat::franka}};
  return choices;
}

}  // namespace dynid
