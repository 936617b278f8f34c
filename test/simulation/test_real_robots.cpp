// SPDX-License-Identifier: Apache-2.0
// Arms as they are published run in closed loop, light wrists and dry friction included. Files of packages
// are looked for in the folders of DYNID_URDF (colons between them) and where Debian, ROS and cmeel put them,
// those with recordings in DYNID_DATA; an arm whose file is nowhere is skipped.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"
#include "robots.hpp"

namespace dynid {
namespace {

using Eigen::MatrixXd;

struct Arm {
  const char *name, *file, *base, *tip;
};
void PrintTo(const Arm& arm, std::ostream* out) { *out << arm.name; }

// Of the package example-robot-data, then of DYNID_DATA.
constexpr Arm arms[] = {
    {"scara", "", "", ""},
    {"panda_urdf", "panda_description/urdf/panda.urdf", "panda_link0", "panda_link8"},
    {"kinova", "kinova_description/robots/kinova.urdf", "", "j2s6s200_end_effector"},
    {"ur3", "ur_description/urdf/ur3_robot.urdf", "base_link", "tool0"},
    {"ur5", "ur_description/urdf/ur5_robot.urdf", "base_link", "tool0"},
    {"ur10", "ur_description/urdf/ur10_robot.urdf", "base_link", "tool0"},
    {"xarm7", "xarm_description/urdf/xarm7.urdf", "", ""},
    {"z1", "z1_description/urdf/z1.urdf", "", ""},
    {"so100", "so_arm_description/urdf/so100.urdf", "", ""},
    {"talos_left_arm", "talos_data/robots/talos_left_arm.urdf", "", ""},
    {"baxter_left", "baxter_description/urdf/baxter.urdf", "torso", "left_gripper"},
    {"tiago", "tiago_description/robots/tiago_no_hand.urdf", "torso_lift_link", "arm_tool_link"},
    {"two_dofs", "asr_twodof_description/urdf/TwoDofs.urdf", "", ""},
    {"double_pendulum", "double_pendulum_description/urdf/double_pendulum.urdf", "", ""},
    {"so101", "so101_real/so101_new_calib.urdf", "", "gripper_frame_link"},
    {"ur10e", "ur10e_real/ur10e.urdf", "", ""},
    {"kuka_lwr4", "kuka_lwr4_real/kuka_lwr4.urdf", "", ""},
    {"psm", "psm_real/psm.urdf", "", ""},
    {"rokae_ar5", "rokae_real/AR5-5_07R-W4C4A2.urdf", "", ""},
};

std::string found(const Arm& arm) {
  std::string folders;
  for (const char* variable : {"DYNID_URDF", "DYNID_DATA"})
    if (const char* text = std::getenv(variable)) folders += std::string(text) + ":";
  for (const char* variable : {"CMAKE_PREFIX_PATH", "CMEEL_PREFIX"})
    if (const char* text = std::getenv(variable)) {
      std::stringstream prefixes(text);
      for (std::string prefix; std::getline(prefixes, prefix, ':');)
        folders += prefix + "/share/example-robot-data/robots:";
    }
  std::stringstream list(folders +
                         "/usr/share/example-robot-data/robots:/usr/local/share/example-robot-data/robots");
  for (std::string folder; std::getline(list, folder, ':');)
    if (const std::string path = folder + "/" + arm.file; !folder.empty() && std::filesystem::exists(path))
      return path;
  return "";
}

class PublishedArm : public ::testing::TestWithParam<Arm> {
 protected:
  void SetUp() override {
    const Arm& arm = GetParam();
    if (*arm.file == '\0') {
      robot_ = test::light_wrist_scara();
      return;
    }
    const std::string path = found(arm);
    if (path.empty()) GTEST_SKIP() << arm.name << ": " << arm.file << " is not on this machine";
    robot_ = read_urdf(path, arm.base, arm.tip);
  }
  Robot robot_;
};

/// Each joint's quantity in units of its scale: the largest.
double worst(const MatrixXd& x, const std::vector<JointScale>& scales, const char* unit) {
  double most = 0.0;
  for (Eigen::Index j = 0; j < x.cols(); ++j)
    most = std::max(most, x.col(j).cwiseAbs().maxCoeff() / scales[static_cast<std::size_t>(j)].of(unit));
  return most;
}

TEST_P(PublishedArm, RunsAndMeasuresWhatItsModelSays) {
  const std::vector<JointScale> scales = joint_scales(robot_);
  for (const bool dry : {false, true}) {
    Robot robot = robot_;
    if (dry)  // friction that jumps, a fifth of what the joint carries
      for (std::size_t j = 0; j < scales.size(); ++j)
        robot.joints[j].friction.linear = {0.02 * scales[j].damping(), 0.2 * scales[j].torque, 0.0, 0.0};
    const Trajectory motion = random_motion(robot, 4.0, 1);
    SimulateOptions options;
    options.rate = 500.0;
    options.record_torques = false;
    const SimulatedRun run = simulate(robot, {}, motion, options);
    MatrixXd left = run.log.tau - predict_torque(robot, run.log.q, run.log.dq, run.seen_ddq).tau;
    for (Eigen::Index j = 0; j < left.cols(); ++j) {  // of what it carries, friction included
      const auto k = static_cast<std::size_t>(j);
      left.col(j) *= scales[k].torque / (scales[k].torque + robot.joints[k].friction.linear.coulomb);
    }
    // At rest a model gives no friction, and a robot any up to Coulomb's.
    for (Eigen::Index j = 0; j < left.cols(); ++j)
      for (Eigen::Index i = 0; i < left.rows(); ++i)
        if (std::abs(run.log.dq(i, j)) < 1e-3 * scales[static_cast<std::size_t>(j)].speed) left(i, j) = 0.0;
    EXPECT_LT(worst(left, scales, "N m"), 1e-6) << (dry ? "with dry friction" : "as published");
    MatrixXd astray = run.q;
    Eigen::VectorXd q(robot.size()), dq(q), ddq(q);
    for (Eigen::Index i = 0; i < astray.rows(); ++i) {
      sample(motion, run.t[i], q, dq, ddq);
      astray.row(i) -= q;
    }
    EXPECT_LT(worst(astray, scales, "rad"), 0.02);
    EXPECT_EQ(simulate(robot, {}, motion, options).log.tau, run.log.tau);
    options.measurement = MeasurementOptions::realistic();
    options.spread = 0.02;
    const SimulatedRun noisy = simulate(robot, {}, motion, options);
    const double noise = worst(noisy.log.tau - noisy.seen_tau, scales, "N m");
    std::printf("  %s%s: left over %.1e, astray %.1e, noise %.1e of the joint's scale\n", GetParam().name,
                dry ? ", dry friction" : "", worst(left, scales, "N m"), worst(astray, scales, "rad"), noise);
    EXPECT_TRUE(noisy.log.tau.allFinite());
  }
}

INSTANTIATE_TEST_SUITE_P(Real, PublishedArm, ::testing::ValuesIn(arms),
                         [](const auto& arm) { return std::string(arm.param.name); });

}  // namespace
}  // namespace dynid
