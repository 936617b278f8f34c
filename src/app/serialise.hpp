// SPDX-License-Identifier: Apache-2.0
//
// The JSON of every report, as docs and CONTRACT have it: what the programs write and publish. Names of files
// that a program wrote are for it to add.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <vector>

#include "dynid/app/blind.hpp"
#include "dynid/app/bounds.hpp"
#include "dynid/app/compare.hpp"
#include "dynid/app/demo.hpp"
#include "dynid/app/diagnose.hpp"
#include "dynid/app/excite.hpp"
#include "dynid/app/export.hpp"
#include "dynid/app/fleet.hpp"
#include "dynid/app/friction.hpp"
#include "dynid/app/identify.hpp"
#include "dynid/app/info.hpp"
#include "dynid/app/init.hpp"
#include "dynid/app/retrieve.hpp"
#include "dynid/app/reverse.hpp"
#include "dynid/app/servo.hpp"
#include "dynid/app/simulate.hpp"
#include "dynid/app/torque.hpp"
#include "dynid/effect/schema.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/signal/prepare.hpp"

namespace dynid {

nlohmann::json to_json(const InitReport& report);
nlohmann::json to_json(const InfoReport& report);
nlohmann::json to_json(const IdentifyReport& report);
nlohmann::json to_json(const FrictionReport& report);
nlohmann::json to_json(const ReverseReport& report);
nlohmann::json to_json(const TorqueReport& report);
nlohmann::json to_json(const RetrieveReport& report);
nlohmann::json to_json(const BoundsReport& report);
nlohmann::json to_json(const ExciteReport& report);
nlohmann::json to_json(const SimulateReport& report);
nlohmann::json to_json(const DiagnoseReport& report);
nlohmann::json to_json(const CompareReport& report);
nlohmann::json to_json(const FleetReport& report);
nlohmann::json to_json(const BlindReport& report);
nlohmann::json to_json(const ExportReport& report);
nlohmann::json to_json(const DemoReport& report);
nlohmann::json to_json(const IdentifyServosReport& report);
nlohmann::json to_json(const ReplayReport& report);

/// The catalogue: `{"effects": [...]}`.
nlohmann::json to_json(const std::vector<EffectSchema>& effects);
/// The effects that were simulated, as a list of {name, joints, parameters}: the labels of a log.
nlohmann::json labels_json(const SimulateReport& report);

nlohmann::json to_json(const Eigen::Ref<const Eigen::VectorXd>& x);
nlohmann::json to_json(const std::vector<Coefficient>& coefficients);
/// Of a log: `[{"name", "joints", "value", "explained_before", "explained_after", "assume", "text"}]`.
nlohmann::json conventions_json(const ConventionReport& report);
/// `{"samples", "rate_hz", "columns", "issues": [{"name", "joints", "value", "unit", "text", "log"}]}` of all
/// logs together.
nlohmann::json to_json(const std::vector<PreparedLog>& logs);

}  // namespace dynid
