// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"

namespace dynid {

nlohmann::json to_json(const Eigen::Ref<const Eigen::VectorXd>& x) {
  return std::vector<double>(x.data(), x.data() + x.size());
}

nlohmann::json to_json(const std::vector<Coefficient>& coefficients) {
  nlohmann::json list = nlohmann::json::array();
  for (const Coefficient& c : coefficients)
    list.push_back({{"name", c.name},
                    {"expression", c.expression},
                    {"value", c.value},
                    {"std_percent", c.std_percent},
                    {"kept", c.kept}});
  return list;
}

nlohmann::json conventions_json(const ConventionReport& report) {
  nlohmann::json conventions = nlohmann::json::array();
  for (const Convention& c : report.conventions)
    conventions.push_back({{"name", c.name},
                           {"joints", c.joints},
                           {"value", c.value},
                           {"explained_before", c.explained_before},
                           {"explained_after", c.explained_after},
                           {"assume", c.assume},
                           {"text", c.text}});
  return conventions;
}

nlohmann::json to_json(const std::vector<PreparedLog>& logs) {
  nlohmann::json issues = nlohmann::json::array();
  Eigen::Index samples = 0;
  for (const PreparedLog& log : logs) {
    samples += log.report.samples;
    for (const DataIssue& issue : log.report.issues)
      issues.push_back({{"name", issue.name},
                        {"joints", issue.joints},
                        {"value", issue.value},
                        {"unit", issue.unit},
                        {"text", issue.text},
                        {"log", log.source}});
  }
  return {{"samples", samples},
          {"rate_hz", logs.front().report.rate_hz},
          {"columns", logs.front().report.columns},
          {"issues", issues}};
}

}  // namespace dynid
