// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <string>
#include <vector>

#include "dynid/app/blind.hpp"
#include "dynid/app/compare.hpp"
#include "dynid/app/demo.hpp"
#include "dynid/app/diagnose.hpp"
#include "dynid/app/excite.hpp"
#include "dynid/app/fleet.hpp"
#include "dynid/app/friction.hpp"
#include "dynid/app/identify.hpp"
#include "dynid/app/info.hpp"
#include "dynid/app/pipeline.hpp"
#include "dynid/app/retrieve.hpp"
#include "dynid/app/reverse.hpp"
#include "dynid/app/servo.hpp"
#include "dynid/app/simulate.hpp"
#include "dynid/app/torque.hpp"
#include "dynid/effect/schema.hpp"
#include "dynid/model/coefficient.hpp"

namespace dynid {

// Summaries for people, some lines each; what was written where is for the caller to say. Allocate.
void print(std::ostream& out, const InfoReport& report);
void print(std::ostream& out, const IdentifyReport& report);
void print(std::ostream& out, const FrictionReport& report);
void print(std::ostream& out, const ReverseReport& report);
void print(std::ostream& out, const RetrieveReport& report);
void print(std::ostream& out, const SimulateReport& report, const std::string& written_to);
void print(std::ostream& out, const TorqueReport& report, const std::string& written_to);
void print(std::ostream& out, const ExciteReport& report, const std::string& written_to);
void print(std::ostream& out, const DiagnoseReport& report);
void print(std::ostream& out, const CompareReport& report);
void print(std::ostream& out, const FleetReport& report);
void print(std::ostream& out, const BlindReport& report);
void print(std::ostream& out, const DemoReport& report);
void print(std::ostream& out, const IdentifyServosReport& report);
void print(std::ostream& out, const ReplayReport& report);
/// The effects that a robot can be simulated with: the catalogue.
void print(std::ostream& out, const std::vector<EffectSchema>& effects);
/// A table of coefficients.
void print(std::ostream& out, const std::vector<Coefficient>& coefficients);

/// The limit that an exciting motion leaves least of: `torque of joint 2: 3.1 N m (3.6 %)`.
std::string in_words(const LimitMargin& margin);
/// Numbers over joints, in a row.
std::string in_a_row(const Eigen::Ref<const Eigen::VectorXd>& x, int digits = 4);

}  // namespace dynid
