// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "dynid/identification/identify.hpp"
#include "dynid/model/link_inertia.hpp"
#include "identification/remarks.hpp"
#include "synthetic.hpp"

namespace dynid {
namespace {

IdentifyOptions fast() {
  IdentifyOptions options;
  options.prepare.cutoff = 20.0;
  options.validate = false;
  return options;
}

const Remark* find(const std::vector<Remark>& remarks, const std::string& name) {
  const auto at =
      std::find_if(remarks.begin(), remarks.end(), [&](const Remark& r) { return r.name == name; });
  return at == remarks.end() ? nullptr : &*at;
}

bool says(const Remark* remark, const std::string& words) {
  return remark != nullptr && remark->text.find(words) != std::string::npos;
}

// Law: never_negative() calls no coefficient so that random consistent links make negative, and those that it
// does not call so, some consistent links do make negative.
TEST(Remarks, OnlySignsThatNoLinksMakeAreImpossible) {
  const Robot robot = test::panda();
  const BaseParameters base = base_parameters(robot, true);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  Eigen::VectorXd lowest = Eigen::VectorXd::Zero(base.size());
  for (int trial = 0; trial < 20000; ++trial) {
    Eigen::VectorXd pi(base.parameters());
    for (int i = 0; i < robot.size(); ++i) {
      // Few points of mass, each link on a scale of its own: near the border of what is consistent.
      const Eigen::Matrix<double, 4, 2> points =
          Eigen::Matrix<double, 4, 2>::NullaryExpr([&] { return normal(random); });
      const double size = std::exp(3.0 * normal(random));
      pi.segment<10>(10 * i) = size * from_pseudo_inertia(points * points.transpose());
    }
    for (int j = 0; j < robot.size(); ++j) pi[base.standard + j] = std::exp(3.0 * normal(random));
    lowest = lowest.cwiseMin(base.K * pi / pi.cwiseAbs().maxCoeff());
  }
  int impossible = 0;
  for (int k = 0; k < base.size(); ++k) {
    const bool never = detail::never_negative(base.K.row(k), base.standard);
    EXPECT_EQ(never, lowest[k] > -1e-9)
        << base.names[static_cast<std::size_t>(k)] << " goes to " << lowest[k];
    impossible += never;
  }
  EXPECT_GE(impossible, 7);  // zz1 and the rotors that stand alone at least
  EXPECT_TRUE(detail::never_negative(base.K.row(0), base.standard)) << base.names[0];
}

TEST(Remarks, AHealthyRobotGetsNone) {
  Robot robot = test::with_linear_friction(test::panda());
  for (unsigned seed : {1u, 2u, 3u}) {
    const Identification id =
        identify(robot, {test::synthetic_log(robot, seed, 20.0, 250.0, 0.3)}, {}, fast());
    EXPECT_TRUE(id.remarks.empty()) << "seed " << seed << ": " << id.remarks.front().text;
  }
}

TEST(Remarks, ATurnedTorqueIsNamed) {
  Robot robot = test::with_linear_friction(test::panda());
  robot.joints[0].parameters[9] = 0.5;  // zz1, which the Panda's own would leave to the noise
  Log log = test::synthetic_log(robot, 4, 20.0, 250.0, 0.01);
  log.tau = -log.tau;
  const Identification id = identify(robot, {log}, {}, fast());
  const Remark* inertia = find(id.remarks, "zz1");
  ASSERT_NE(inertia, nullptr);
  EXPECT_EQ(inertia->joint, 1);
  EXPECT_LT(inertia->value, -4.0 * inertia->std);
  for (int j = 1; j <= 7; ++j) {
    EXPECT_TRUE(says(find(id.remarks, "fv" + std::to_string(j)), "sign turned")) << j;
    EXPECT_TRUE(says(find(id.remarks, "fc" + std::to_string(j)), "sign turned")) << j;
  }
}

TEST(Remarks, APlaceholderDampingTakenOffTheTorqueIsNamedWithItsSize) {
  Robot robot = test::with_linear_friction(test::panda());
  const Log log = test::synthetic_log(robot, 5, 20.0, 250.0, 0.1);
  Log recorded = log;
  Robot nominal = robot;
  for (Joint& joint : nominal.joints) joint.friction = {{1.0, 0.0, 0.0, 0.02}, {}};
  recorded.tau.col(2) -= 1.0 * log.dq.col(2);
  const Identification id = identify(nominal, {recorded}, {}, fast());
  ASSERT_EQ(id.remarks.size(), 1u);
  EXPECT_EQ(id.remarks[0].name, "fv3");
  EXPECT_EQ(id.remarks[0].joint, 3);
  EXPECT_NEAR(id.remarks[0].value, robot.joints[2].friction.linear.viscous - 1.0, 0.05);
  EXPECT_TRUE(says(&id.remarks[0], "a damping of 1 N m s/rad")) << id.remarks[0].text;
  EXPECT_TRUE(says(&id.remarks[0], "placeholder")) << id.remarks[0].text;
}

TEST(Remarks, NegativeRotorInertiaIsNamed) {
  const Robot robot = test::with_linear_friction(test::panda());
  Robot geared = robot;
  geared.joints[5].rotor_inertia = 0.2;
  Log log = test::synthetic_log(robot, 6, 20.0, 250.0, 0.05);
  const Log with = test::synthetic_log(geared, 6, 20.0, 250.0, 0.05);
  log.tau -= with.tau - log.tau;  // what a compensation of a rotor that is not there leaves
  IdentifyOptions options = fast();
  options.rotor_inertia = true;
  const Identification id = identify(test::panda(), {log}, {}, options);
  EXPECT_TRUE(says(find(id.remarks, "ia6"), "rotor inertia below 0 on joint 6"));
}

TEST(Remarks, AnErrorOfHalfTheTorqueIsNamedByItself) {
  const Robot robot = test::with_linear_friction(test::panda());
  Log log = test::synthetic_log(robot, 7);
  log.tau.rowwise().reverseInPlace();  // joints in another order
  const Identification id = identify(robot, {log}, {}, fast());
  EXPECT_GT(id.fit.relative_error_percent, 50.0);
  const Remark* error = find(id.remarks, "relative_error");
  ASSERT_NE(error, nullptr);
  EXPECT_EQ(error->joint, 0);
  EXPECT_EQ(error->value, id.fit.relative_error_percent);
  EXPECT_EQ(error, &id.remarks.back());
  IdentifyOptions patient = fast();
  patient.remarks.relative_error_percent = 1000.0;
  EXPECT_EQ(find(identify(robot, {log}, {}, patient).remarks, "relative_error"), nullptr);
}

}  // namespace
}  // namespace dynid
