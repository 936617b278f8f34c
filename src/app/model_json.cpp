// SPDX-License-Identifier: Apache-2.0
#include "app/serialise.hpp"

namespace dynid {

nlohmann::json to_json(const BoundsReport& report) {
  return {{"robot", report.robot},
          {"links", report.lower.size() / 10},
          {"with_mass", report.with_mass},
          {"with_geometry", report.with_geometry},
          {"total_mass", {report.total_mass[0], report.total_mass[1]}},
          {"lower", to_json(report.lower)},
          {"upper", to_json(report.upper)},
          {"notes", report.notes}};
}

nlohmann::json to_json(const InitReport& report) {
  nlohmann::json joints = nlohmann::json::array();
  for (const Joint& joint : report.robot.joints)
    joints.push_back({{"name", joint.name},
                      {"a", joint.dh->a},
                      {"alpha", joint.dh->alpha},
                      {"d", joint.dh->d},
                      {"theta", joint.dh->theta}});
  return {{"robot", report.robot.name}, {"joints", joints}};
}

}  // namespace dynid
