// SPDX-License-Identifier: Apache-2.0
// Banks that were written, read again for a calibration.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "app/serialise.hpp"
#include "dynid/app/blind.hpp"
#include "dynid/base/error.hpp"
#include "dynid/diagnosis/calibration.hpp"

namespace dynid {
namespace {

BlindReport bank(unsigned seed, int cases) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  BlindReport out;
  for (int k = 0; k < cases; ++k) {
    BlindCase c;
    const double there = 1.0 + std::abs(normal(random)), found = there * (1.0 + 0.03 * normal(random));
    c.truth = {{"coulomb_friction", {2}, {{"coefficient", {0.0, there}}}}};
    c.drawn = {{"duration", std::to_string(10 + k)}};
    c.nominal_error = k % 2 == 0 ? 0.02 : 0.0;
    if (k % 5 == 0) c.withheld = {"backlash"};
    if (k % 7 == 0) c.background = {"viscous_friction"};
    if (k % 11 == 0) c.failure = "thrown";
    FoundEffect e;
    e.effect = {"coulomb_friction", {2}, {{"coefficient", {0.0, found}}}};
    ParameterEstimate p;
    p.key = "coefficient";
    p.value = Eigen::Vector2d(0.0, found);
    p.low = Eigen::Vector2d(0.0, 0.99 * found);
    p.high = Eigen::Vector2d(0.0, 1.01 * found);
    p.per_joint = true;
    e.parameters = {p};
    c.found = {e};
    ConsideredEffect weighed{k % 3 == 0 ? "backlash" : "coulomb_friction", {2}, 0.9, {}, 0.8};
    for (double& x : weighed.grounds.value) x = normal(random);
    c.considered = {weighed};
    out.cases.push_back(c);
  }
  return out;
}

// Law: what is read of a bank that was written makes the calibration that the bank itself makes.
TEST(BlindCases, AreReadAsTheyWereWritten) {
  const BlindReport report = bank(1, 80);
  const std::vector<BlindCase> read = blind_cases(to_json(report).dump(), "a.json");
  EXPECT_EQ(calibration_yaml(fit_calibration(read), ""), calibration_yaml(fit_calibration(report.cases), ""));
}

TEST(BlindCases, WhatIsNoneIsNamed) {
  for (const char* text :
       {"", "[]", "{\"list\": [{}]}", R"({"list": [{"truth": [{"name": "none"}]}]})",
        R"({"list": [{"truth": [], "found": [{"name": "no_such", "joints": [], "parameters": {},
            "probability": 1, "aliases": [], "intervals": {}}]}]})"}) {
    SCOPED_TRACE(text);
    try {
      blind_cases(text, "bank.json");
      ADD_FAILURE() << "taken";
    } catch (const Error& e) {
      EXPECT_EQ(std::string(e.what()).rfind("bank.json: ", 0), 0u) << e.what();
    }
  }
}

}  // namespace
}  // namespace dynid
