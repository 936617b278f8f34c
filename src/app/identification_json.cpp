// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "app/serialise.hpp"
#include "app/words.hpp"
#include "dynid/app/choices.hpp"

namespace dynid {
namespace {

/// JSON has no infinity: a limit that is not known is null.
nlohmann::json number(double x) { return std::isfinite(x) ? nlohmann::json(x) : nlohmann::json(nullptr); }

nlohmann::json joint_json(const Joint& joint) {
  return {{"name", joint.name},
          {"link", joint.link_name},
          {"type", detail::word_for(joint.type)},
          {"lower", number(joint.limits.lower)},
          {"upper", number(joint.limits.upper)},
          {"velocity", number(joint.limits.velocity)},
          {"acceleration", number(joint.limits.acceleration)},
          {"jerk", number(joint.limits.jerk)},
          {"torque", number(joint.limits.torque)},
          {"torque_rate", number(joint.limits.torque_rate)}};
}

nlohmann::json quality_json(const FitQuality& q) {
  return {{"source", q.source},
          {"rows", q.rows},
          {"rmse", to_json(q.rmse)},
          {"relative_error_percent", q.relative_error_percent}};
}

nlohmann::json comparison_json(const std::vector<FrictionComparison>& comparison) {
  nlohmann::json list = nlohmann::json::array();
  for (const FrictionComparison& c : comparison)
    list.push_back({{"joint", c.joint},
                    {"held_out_rms", {{"linear", c.linear}, {"sigmoid", c.sigmoid}}},
                    {"law", word_for(friction_laws(), c.chosen)}});
  return list;
}

nlohmann::json friction_json(const JointFriction& f) {
  return {{"viscous", f.linear.viscous}, {"coulomb", f.linear.coulomb}, {"offset", f.linear.offset},
          {"phi1", f.sigmoid.phi1},      {"phi2", f.sigmoid.phi2},      {"phi3", f.sigmoid.phi3}};
}

}  // namespace

nlohmann::json to_json(const InfoReport& report) {
  const Robot& robot = report.robot;
  const BaseParameters& base = report.base;
  nlohmann::json joints = nlohmann::json::array(), coefficients = nlohmann::json::array(),
                 parameters = nlohmann::json::array(), rules = nlohmann::json::array();
  for (const Joint& joint : robot.joints) joints.push_back(joint_json(joint));
  for (std::size_t i = 0; i < base.names.size(); ++i)
    coefficients.push_back({{"name", base.names[i]}, {"expression", base.expressions[i]}});
  for (int k = 0; k < base.parameters(); ++k)
    parameters.push_back(
        {{"name", parameter_name(k, robot.size())},
         {"identifiable", detail::word_for(report.parameters[static_cast<std::size_t>(k)])}});
  for (const Inconsistency& rule : report.broken)
    rules.push_back(
        {{"joint", rule.joint}, {"link", rule.link}, {"rule", rule.rule}, {"margin", rule.margin}});
  return {{"name", robot.name},
          {"joints", joints},
          {"gravity", to_json(robot.gravity)},
          {"total_mass", report.total_mass},
          {"rank", base.size()},
          {"base_parameters", coefficients},
          {"standard_parameters", parameters},
          {"physically_consistent", report.broken.empty()},
          {"inconsistencies", rules}};
}

nlohmann::json to_json(const IdentifyReport& report) {
  const Identification& id = report.identification;
  nlohmann::json result = {{"rank", id.rank},
                           {"condition_number", id.condition_number},
                           {"relative_error_percent", id.fit.relative_error_percent},
                           {"rmse", to_json(id.fit.rmse)},
                           {"cutoff_hz", id.cutoff},
                           {"noise", to_json(id.noise)},
                           {"correlation", to_json(id.correlation)},
                           {"physically_consistent", report.physically_consistent},
                           {"coefficients", to_json(id.coefficients)},
                           {"data", to_json(id.logs)},
                           {"seconds", report.seconds}};
  if (id.validation) {
    result["validation"] = quality_json(*id.validation);
  } else {
    result["validation"] = {
        {"source", id.validation_note}, {"rmse", nullptr}, {"relative_error_percent", nullptr}};
  }
  if (!id.friction.empty()) result["friction_laws"] = comparison_json(id.friction);
  result["data"]["conventions"] = conventions_json(report.conventions);
  result["data"]["equivalent_readings"] = report.conventions.equivalents;
  result["data"]["undecided_readings"] = report.conventions.undecided;
  result["remarks"] = nlohmann::json::array();
  for (const Remark& r : id.remarks)
    result["remarks"].push_back(
        {{"name", r.name}, {"joint", r.joint}, {"value", r.value}, {"std", r.std}, {"text", r.text}});
  return result;
}

nlohmann::json to_json(const FrictionReport& report) {
  const TwoStageFriction& fitted = report.friction;
  nlohmann::json friction = nlohmann::json::array();
  for (const Joint& joint : fitted.robot.joints) friction.push_back(friction_json(joint.friction));
  return {{"friction", friction},
          {"before", quality_json(fitted.before)},
          {"rmse", to_json(fitted.after.rmse)},
          {"relative_error_percent", fitted.after.relative_error_percent},
          {"friction_laws", comparison_json(fitted.comparison)},
          {"data", {{"conventions", conventions_json(report.conventions)}}},
          {"seconds", report.seconds}};
}

nlohmann::json to_json(const ReverseReport& report) {
  const ReverseIdentification& id = report.identification;
  return {{"rank", id.rank},
          {"condition_number", id.condition_number},
          {"relative_error_percent", id.relative_error_percent},
          {"rmse", to_json(id.rmse)},
          {"rmse_inertia", to_json(id.rmse_inertia)},
          {"validation",
           {{"source", "every fifth sample, left out of a second fit"},
            {"rmse", to_json(id.validation_rmse)},
            {"relative_error_percent", id.validation_relative_error_percent}}},
          {"physically_consistent", report.physically_consistent},
          {"coefficients", to_json(id.coefficients)},
          {"seconds", report.seconds}};
}

nlohmann::json to_json(const TorqueReport& report) {
  nlohmann::json result = {{"samples", report.samples()}};
  if (report.rms_difference.size() > 0) result["rms_difference"] = to_json(report.rms_difference);
  return result;
}

nlohmann::json to_json(const ExportReport& report) {
  return {{"format", word_for(export_formats(), report.format)}, {"not_expressed", report.not_expressed}};
}

nlohmann::json to_json(const DemoReport& report) {
  const Identification& id = report.identification;
  nlohmann::json hidden = nlohmann::json::array();
  for (const Effect& effect : report.hidden)
    hidden.push_back({{"name", effect.name}, {"joints", effect.joints}, {"parameters", effect.parameters}});
  return {{"rank", id.rank},
          {"relative_error_percent", id.fit.relative_error_percent},
          {"rmse", to_json(id.fit.rmse)},
          {"total_mass", report.retrieval.result.total_mass},
          {"feasible", report.retrieval.result.feasible},
          {"hidden", hidden},
          {"diagnosis", to_json(report.diagnosis)},
          {"seconds", report.seconds}};
}

}  // namespace dynid
