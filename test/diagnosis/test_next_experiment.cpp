// SPDX-License-Identifier: Apache-2.0
// The experiment proposed tells apart what the log did not.
#include <gtest/gtest.h>

#include "../../src/diagnosis/next_experiment.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

Robot panda() { return read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot; }

Diagnosis aliased(const Effect& effect, const std::vector<std::string>& aliases) {
  Diagnosis d;
  d.verdict = Verdict::explained;
  d.floor = Eigen::VectorXd::Constant(7, 0.03);
  d.cutoff = 10.0;
  FoundEffect found;
  found.effect = effect;
  found.aliases = aliases;
  d.effects = {found};
  return d;
}

void expect_within_limits(const Robot& robot, const Trajectory& motion) {
  for (int j = 0; j < robot.size(); ++j) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    EXPECT_GE(motion.q.col(j).minCoeff(), limits.lower) << "joint " << j + 1;
    EXPECT_LE(motion.q.col(j).maxCoeff(), limits.upper) << "joint " << j + 1;
    EXPECT_LE(motion.dq.col(j).cwiseAbs().maxCoeff(), limits.velocity) << "joint " << j + 1;
  }
}

TEST(NextExperiment, TellsCoulombFromViscousFriction) {
  const Robot robot = panda();
  const NextExperiment next = detail::next_experiment(
      robot,
      aliased({"coulomb_friction",
               {4},
               {{"coefficient", {0, 0, 0, 1.0, 0, 0, 0}}, {"velocity_scale", {0, 0, 0, 0.01, 0, 0, 0}}}},
              {"viscous_friction"}));
  ASSERT_EQ(next.separates.size(), 1u) << next.text;
  EXPECT_EQ(next.separates[0].first, "coulomb_friction");
  EXPECT_EQ(next.separates[0].second, "viscous_friction");
  ASSERT_GT(next.motion.samples(), 0);
  expect_within_limits(robot, next.motion);
}

TEST(NextExperiment, OffsetAndAsymmetryNeedStandstillOrReversals) {
  // While a joint moves one is the other: only where it turns or stands do they differ.
  const Robot robot = panda();
  const NextExperiment next =
      detail::next_experiment(robot, aliased({"torque_offset", {2}, {{"offset", {0, 1.0, 0, 0, 0, 0, 0}}}},
                                             {"asymmetric_coulomb_friction"}));
  ASSERT_EQ(next.separates.size(), 1u) << next.text;
  EXPECT_TRUE(next.text.find("static poses") != std::string::npos ||
              next.text.find("reversals") != std::string::npos)
      << next.text;
  expect_within_limits(robot, next.motion);
}

TEST(NextExperiment, SaysWhereNoMotionHelps) {
  // A spring with its rest free, as it is fitted, contains the offset.
  const NextExperiment next = detail::next_experiment(
      panda(), aliased({"torque_offset", {2}, {{"offset", {0, 1.0, 0, 0, 0, 0, 0}}}}, {"joint_spring"}));
  EXPECT_TRUE(next.separates.empty()) << next.text;
  EXPECT_EQ(next.motion.samples(), 0);
  EXPECT_FALSE(next.text.empty());
}

TEST(NextExperiment, AlwaysSaysSomething) {
  for (const Verdict verdict :
       {Verdict::no_gap, Verdict::not_detected, Verdict::explained, Verdict::partly_explained,
        Verdict::unexplained, Verdict::misread, Verdict::data_invalid}) {
    Diagnosis d;
    d.verdict = verdict;
    EXPECT_FALSE(detail::next_experiment(panda(), d).text.empty()) << to_string(verdict);
  }
}

}  // namespace
}  // namespace dynid
