// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "app/serialise.hpp"

namespace dynid {
namespace {

nlohmann::json margin_json(const LimitMargin& m) {
  nlohmann::json one = {{"name", m.name}, {"margin", m.margin}, {"unit", m.unit}, {"share", m.share}};
  if (m.joint > 0) one["joint"] = m.joint;
  if (!m.between.empty()) one["between"] = m.between;
  return one;
}

nlohmann::json coefficients_json(const ExcitingMotion& motion) {
  nlohmann::json a = nlohmann::json::array(), b = nlohmann::json::array();
  const int L = motion.shape().harmonics;
  for (int l = 0; l < L; ++l) {
    a.push_back(to_json(Eigen::VectorXd(motion.coefficients().row(l))));
    b.push_back(to_json(Eigen::VectorXd(motion.coefficients().row(L + l))));
  }
  return {{"a", a}, {"b", b}, {"q0", to_json(motion.offset())}};
}

}  // namespace

nlohmann::json to_json(const ExciteReport& report) {
  const Excitation& found = report.found;
  const MotionShape& shape = found.motion.shape();
  nlohmann::json runs = nlohmann::json::array(), margins = nlohmann::json::array();
  for (const ExciteRun& r : found.runs)
    runs.push_back({{"start", r.start},
                    {"base_period", r.base_period},
                    {"criterion", r.criterion},
                    {"feasible", r.feasible},
                    {"evaluations", r.evaluations}});
  for (const LimitMargin& margin : found.margins) margins.push_back(margin_json(margin));
  nlohmann::json result = {
      {"feasible", found.feasible},
      {"columns", found.columns},
      {"condition_number", found.condition_number},
      {"log_determinant", found.log_determinant},
      {"duration", shape.duration},
      {"base_period", 2.0 * M_PI / shape.omega},
      {"omega", shape.omega},
      {"harmonics", shape.harmonics},
      {"coefficients", coefficients_json(found.motion)},
      {"collision", report.collision.empty() ? nlohmann::json() : nlohmann::json(report.collision)},
      {"margins", margins},
      {"runs", runs},
      {"seconds", report.seconds}};
  if (found.limiting >= 0)
    result["limiting"] = margin_json(found.margins[static_cast<std::size_t>(found.limiting)]);
  if (!report.compared.empty())
    result["compare"] = {{"source", report.compared}, {"condition_number", report.compared_condition_number}};
  if (found.feasible) result["samples"] = report.motion.samples();
  return result;
}

}  // namespace dynid
