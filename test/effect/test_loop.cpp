// SPDX-License-Identifier: Apache-2.0
// The loop's part of the contract: it computes an effect as the offline prediction does, or refuses it by
// name.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "contract.hpp"
#include "dynid/estimation/torque_estimator.hpp"

namespace dynid {
namespace {

using namespace test;

class LoopContract : public EffectOnRobot {};

TEST_P(LoopContract, TheLoopComputesItOrRefusesItByName) {
  for (const Effect& effect : cases_) {
    const Robot model = with(robot_, effect);
    if (!schema_.in_loop()) {
      for (const std::string& what : {error_of([&] { TorqueModel<> loop(model); }),
                                      error_of([&] { TorqueEstimator<> estimator(model); })}) {
        EXPECT_EQ(what.rfind("effect '" + schema_.name + "' cannot run in the loop: it depends on ", 0), 0U)
            << what;
        EXPECT_GT(what.size(), schema_.name.size() + 55U) << what;
      }
      EXPECT_EQ(uncompensated_effects(model), std::vector<std::string>{schema_.name});
      EXPECT_NO_THROW(TorqueModel<>(model, Uncompensated::ignore));
      continue;
    }
    EXPECT_TRUE(uncompensated_effects(model).empty());
    const Log log = seen(run(robot_, {effect}));
    const Eigen::MatrixXd expected = predicted(model, log);
    TorqueEstimatorOptions slow;
    slow.gain = Eigen::VectorXd::Constant(1, 30.0);
    TorqueEstimator<> estimator(model, slow), without(robot_, slow);
    double worst = 0.0, residual = 0.0, residual_without = 0.0;
    for (Eigen::Index i = 0; i < log.samples(); ++i) {
      const Eigen::VectorXd q = log.q.row(i), dq = log.dq.row(i), tau = log.tau.row(i), ddq = log.ddq.row(i);
      const Estimate<>& now = estimator.step(1e-3, q, dq, tau, ddq);
      ASSERT_FALSE(has(now.status, Status::bad_input)) << i;
      worst = std::max(worst, (now.tau_model - expected.row(i).transpose()).cwiseAbs().maxCoeff());
      residual += now.residual.squaredNorm();
      residual_without += without.step(1e-3, q, dq, tau, ddq).residual.squaredNorm();
    }
    EXPECT_LT(worst, 1e-9) << effect.name;
    // And the momentum observer sees no push where there is none.
    EXPECT_LT(std::sqrt(residual), 0.2 * std::sqrt(residual_without)) << effect.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, LoopContract, ::testing::ValuesIn(all_cases()), case_name);

// Several of one kind on one joint, and all that the loop can compute at once.
TEST(Effect, AllThatTheLoopComputesAddUp) {
  Robot robot = robot_of("panda");
  const SimulatedRun still = run(robot, {});
  const Log log = seen(still);
  for (const char* text :
       {"stribeck_friction", "asymmetric_coulomb_friction", "coulomb_friction:velocity_scale=0.02",
        "coulomb_friction:coefficient=0.3,velocity_scale=0.05", "joint_spring", "torque_ripple",
        "load_dependent_friction", "torque_gain", "gear_coupling", "payload", "gravity_tilt",
        "encoder_offset", "rotor_inertia", "torque_offset", "viscous_friction", "link_inertial_error"})
    robot.effects.push_back(parse_effect(text, robot));
  const Eigen::MatrixXd expected = predicted(robot, log);
  EXPECT_GT((expected - log.tau).norm(), 1.0);
  const TorqueModel<7> loop(robot);
  Workspace<7> ws(loop.rigid_body());
  for (Eigen::Index i = 0; i < log.samples(); i += 7) {
    const Eigen::Matrix<double, 7, 1> q = log.q.row(i), dq = log.dq.row(i), ddq = log.ddq.row(i);
    Eigen::Matrix<double, 7, 1> friction, tau;
    loop.friction(q, dq, friction);
    loop.torque(ws, q, dq, ddq, friction, tau);
    ASSERT_LT((tau - expected.row(i).transpose()).cwiseAbs().maxCoeff(), 1e-9) << i;
  }
}

}  // namespace
}  // namespace dynid
