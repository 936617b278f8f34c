// SPDX-License-Identifier: Apache-2.0
// The plant without effects is a rigid body: it keeps energy, and moves as MuJoCo says.
#include "dynid/simulation/plant.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <random>

#ifdef DYNID_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

#include "dynid/dynamics/dynamics.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/model/export.hpp"
#include "robots.hpp"

namespace dynid {
namespace {

using Eigen::VectorXd;

VectorXd random_vector(std::mt19937_64& random, int n, double size) {
  std::uniform_real_distribution<double> uniform(-size, size);
  VectorXd x(n);
  for (double& value : x) value = uniform(random);
  return x;
}

TEST(Plant, KeepsItsEnergyUndriven) {
  const Robot robot = test::frictionless_panda();
  const Model<> model(robot);
  Workspace<> ws(model);
  VectorXd q(7), dq(7);
  q << 0.3, -0.4, 0.2, -1.5, 0.1, 1.6, 0.5;
  dq << 0.1, -0.2, 0.3, 0.1, -0.3, 0.2, 0.1;
  Plant plant(robot);
  plant.reset(q, dq);
  double kinetic_peak = 0.0, worst = 0.0;
  const double start = kinetic_energy(model, ws, q, dq) + potential_energy(model, ws, q);
  for (int k = 0; k < 10000; ++k) {
    plant.step(VectorXd::Zero(7), 1e-3);
    const double kinetic = kinetic_energy(model, ws, plant.q(), plant.dq());
    kinetic_peak = std::max(kinetic_peak, kinetic);
    worst = std::max(worst, std::abs(kinetic + potential_energy(model, ws, plant.q()) - start));
  }
  std::printf("  drift over 10 s: %.1e of a kinetic energy of %.0f J\n", worst / kinetic_peak, kinetic_peak);
  EXPECT_GT(kinetic_peak, 10.0);  // it did swing
  EXPECT_LT(worst / kinetic_peak, 1e-6);
}

TEST(Plant, KeepsTheEnergyOfASpringInAJoint) {
  Robot robot = test::frictionless_panda();
  Effect spring = {"joint_spring", {1, 2, 4}, {}};
  spring.parameters["stiffness"] = {30, 20, 0, 10, 0, 0, 0};
  robot.effects = {spring};
  const Model<> model(robot);
  Workspace<> ws(model);
  const VectorXd q = (VectorXd(7) << 0.3, -0.4, 0.2, -1.5, 0.1, 1.6, 0.5).finished();
  Plant plant(robot);
  plant.reset(q, VectorXd::Zero(7));
  const auto energy = [&] {
    double sum = kinetic_energy(model, ws, plant.q(), plant.dq()) + potential_energy(model, ws, plant.q());
    for (int j = 0; j < 7; ++j)
      sum += 0.5 * spring.parameters["stiffness"][static_cast<std::size_t>(j)] * plant.q()[j] * plant.q()[j];
    return sum;
  };
  const double start = energy();
  double worst = 0.0;
  for (int k = 0; k < 2000; ++k) {
    plant.step(VectorXd::Zero(7), 1e-3);
    worst = std::max(worst, std::abs(energy() - start));
  }
  EXPECT_LT(worst, 1e-6 * 20.0);
}

TEST(Plant, EnergyGoesWhereFrictionTakesIt) {
  // Change of energy = work of the drives - work of friction, also through standstill of light joints.
  for (const bool jumps : {false, true}) {
    Robot robot = test::light_wrist_scara();
    if (!jumps)
      for (Joint& joint : robot.joints) joint.friction.linear.velocity_scale = 0.02 * joint.limits.velocity;
    const int n = robot.size();
    const Model<> model(robot);
    Workspace<> ws(model);
    Plant plant(robot);
    plant.reset((VectorXd(4) << 0.3, -0.4, 0.0, 0.5).finished(), VectorXd::Zero(n));
    const auto energy = [&] {
      return kinetic_energy(model, ws, plant.q(), plant.dq()) + potential_energy(model, ws, plant.q());
    };
    const auto power = [&] {  // what is put in less what friction takes
      VectorXd left = plant.tau();
      for (int j = 0; j < n; ++j) {
        LinearFriction f = robot.joints[static_cast<std::size_t>(j)].friction.linear;
        f.velocity_scale =
            std::max(f.velocity_scale, 1e-4 * robot.joints[static_cast<std::size_t>(j)].limits.velocity);
        left[j] -= friction_torque(f, plant.dq()[j]);
      }
      return left.dot(plant.dq());
    };
    const double start = energy();
    double sum = 0.0, through = 0.0, worst = 0.0;
    int reversals = 0;
    for (int k = 0; k < 12000; ++k) {
      const double before = power();
      const VectorXd dq = plant.dq();
      const double t = 0.25e-3 * k;
      plant.step((VectorXd(4) << 8.0 * std::sin(6.0 * t), 4.0 * std::sin(9.0 * t),
                  5.9 + 8.0 * std::sin(20.0 * t), 0.12 * std::sin(15.0 * t))
                     .finished(),
                 0.25e-3);
      const double now = power();
      sum += 0.5 * (before + now) * 0.25e-3;
      through += 0.5 * std::abs(before + now) * 0.25e-3;
      worst = std::max(worst, std::abs(energy() - start - sum));
      for (int j = 0; j < n; ++j) reversals += dq[j] * plant.dq()[j] < 0.0 ? 1 : 0;
    }
    std::printf("  %s: %.1e of the energy that went through is not accounted for; %d reversals\n",
                jumps ? "friction that jumps" : "smooth friction", worst / through, reversals);
    EXPECT_GT(through, 1.0);
    EXPECT_GT(reversals, 20);
    EXPECT_LT(worst, 2e-3 * through);
  }
}

TEST(Plant, SticksUntilItBreaksAway) {
  // A joint of 1e-5 kg m^2 under 0.9 of its Coulomb friction stays where it is, and beyond it goes as Newton
  // says.
  Robot robot = test::light_wrist_scara();
  robot.joints = {robot.joints.back()};
  robot.gravity.setZero();
  const double inertia = Model<>(robot).moments(0).xx + Model<>(robot).moments(0).yy;
  const LinearFriction& f = robot.joints[0].friction.linear;
  Plant plant(robot);
  const double speed = robot.joints[0].limits.velocity;
  for (const double from : {0.0, 0.3 * speed, -0.3 * speed}) {  // it comes to rest first
    plant.reset(VectorXd::Zero(1), VectorXd::Constant(1, from));
    const VectorXd held = VectorXd::Constant(1, 0.9 * f.coulomb);
    for (int k = 0; k < 300; ++k) plant.step(held, 1e-3);
    const double there = plant.q()[0];
    for (int k = 0; k < 5000; ++k) {
      plant.step(held, 1e-3);
      ASSERT_LE(std::abs(plant.dq()[0]), 2e-4 * speed) << k;
      ASSERT_LE(std::abs(plant.ddq()[0]) * inertia, 1e-6 * f.coulomb) << k;
    }
    EXPECT_LT(std::abs(plant.q()[0] - there), 5.0 * 2e-4 * speed);
    const VectorXd pushed = VectorXd::Constant(1, 1.0001 * f.coulomb + 0.01 * f.viscous * speed);
    for (int k = 0; k < 2000; ++k) plant.step(pushed, 1e-3);
    const double settled = (pushed[0] - f.coulomb) / f.viscous;
    EXPECT_NEAR(plant.dq()[0], settled, 1e-3 * settled);
  }
}

TEST(Plant, RefusesAJointWithoutInertia) {
  Robot robot = test::light_wrist_scara();
  robot.joints.back().parameters.setZero();
  EXPECT_THROW(Plant{robot}, Error);
  robot.joints.back().rotor_inertia = 1e-6;
  EXPECT_NO_THROW(Plant{robot});
}

TEST(Plant, WrenchOnTheTipIsInTheEquationOfMotion) {
  // M ddq + S dq + g + friction = tau + J^T F at every instant, F in either frame's axes.
  const Robot robot = test::panda();
  const Model<> model(robot);
  Workspace<> ws(model);
  std::mt19937_64 random(5);
  for (const bool tip_axes : {false, true}) {
    Plant plant(robot);
    plant.reset(random_vector(random, 7, 0.5), random_vector(random, 7, 0.5));
    const Eigen::Matrix<double, 6, 1> given = random_vector(random, 6, 20.0);
    plant.set_tip_wrench(given, tip_axes);
    VectorXd expected(7);
    for (int k = 0; k < 50; ++k) {
      plant.step(random_vector(random, 7, 5.0), 1e-3);
      inverse_dynamics(model, ws, plant.q(), plant.dq(), plant.ddq(), expected);
      for (int j = 0; j < 7; ++j)
        expected[j] += friction_torque(robot.joints[static_cast<std::size_t>(j)].friction, plant.dq()[j]);
      std::vector<Eigen::Isometry3d> poses(8);
      forward_kinematics(model, ws, plant.q(), poses);
      Eigen::Matrix<double, 6, 1> wrench = given;
      if (tip_axes) wrench << poses[7].linear() * given.head<3>(), poses[7].linear() * given.tail<3>();
      Eigen::MatrixXd J(6, 7);
      jacobian(model, ws, plant.q(), robot.tip, J);
      const VectorXd error = plant.tau() + J.transpose() * wrench - expected;
      ASSERT_LT(error.cwiseAbs().maxCoeff(), 1e-9) << "tip axes " << tip_axes << ", step " << k;
    }
    // Taken away again, it is as if it had never been.
    plant.set_tip_wrench(Eigen::Matrix<double, 6, 1>::Zero(), tip_axes);
    const VectorXd q = plant.q(), dq = plant.dq(), tau = plant.tau();
    Plant other(robot);
    other.reset(q, dq, tau);
    other.step(tau, 1e-3);
    plant.step(tau, 1e-3);
    EXPECT_LT((plant.q() - other.q()).cwiseAbs().maxCoeff(), 1e-12);
  }
  Plant plant(robot);
  EXPECT_THROW(plant.set_tip_wrench(Eigen::Matrix<double, 6, 1>::Constant(NAN)), Error);
}

TEST(Plant, AccelerationsAreThoseOfTheTorque) {
  // tau = M ddq + S dq + g + friction at every instant, the drive's torque going linearly through a step.
  const Robot robot = test::panda();
  const Model<> model(robot);
  Workspace<> ws(model);
  Plant plant(robot);
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937_64 random(seed);
    plant.reset(random_vector(random, 7, 2.0), random_vector(random, 7, 1.0), random_vector(random, 7, 10.0));
    for (int k = 0; k < 5; ++k) {
      const VectorXd command = random_vector(random, 7, 10.0);
      plant.step(command, 1e-3);
      VectorXd tau(7);
      inverse_dynamics(model, ws, plant.q(), plant.dq(), plant.ddq(), tau);
      for (int j = 0; j < 7; ++j)
        tau[j] += friction_torque(robot.joints[static_cast<std::size_t>(j)].friction, plant.dq()[j]);
      EXPECT_LT((tau - command).cwiseAbs().maxCoeff(), 1e-9) << "seed " << seed;
      EXPECT_LT((plant.tau() - command).cwiseAbs().maxCoeff(), 1e-12) << "seed " << seed;
    }
  }
}

TEST(Plant, RefusesWhatItCannotRun) {
  Plant plant(test::panda());
  EXPECT_THROW(plant.step(VectorXd::Zero(6), 1e-3), Error);
  EXPECT_THROW(plant.step(VectorXd::Zero(7), 0.0), Error);
  EXPECT_THROW(plant.step(VectorXd::Constant(7, NAN), 1e-3), Error);
  EXPECT_THROW(plant.reset(VectorXd::Zero(3), VectorXd::Zero(7)), Error);
}

TEST(Plant, IsTheSameAfterAReset) {
  Robot robot = test::panda();
  robot.effects = {
      {"presliding_hysteresis", {}, {}}, {"time_delay", {}, {}}, {"thermal_friction_drift", {}, {}}};
  Plant plant(robot);
  const VectorXd q = VectorXd::Constant(7, 0.3), tau = VectorXd::Constant(7, 2.0);
  const auto run = [&] {
    plant.reset(q, VectorXd::Zero(7));
    for (int k = 0; k < 100; ++k) plant.step(tau, 1e-3);
    return (VectorXd(14) << plant.q(), plant.measured_tau()).finished();
  };
  const VectorXd first = run();
  EXPECT_EQ(run(), first);
}

#ifdef DYNID_HAVE_MUJOCO

class Mujoco : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string text = to_mjcf(robot_).text;
    const auto vfs = std::make_unique<mjVFS>();
    mj_defaultVFS(vfs.get());
    mj_makeEmptyFileVFS(vfs.get(), "robot.xml", static_cast<int>(text.size()));
    std::copy(text.begin(), text.end(), static_cast<char*>(vfs->filedata[0]));
    char error[500] = "";
    model_.reset(mj_loadXML("robot.xml", vfs.get(), error, sizeof error));
    mj_deleteVFS(vfs.get());
    ASSERT_TRUE(model_) << error;
    // Bodies alone: limits, damping and clamped motors of the format are not the question.
    model_->opt.disableflags |= mjDSBL_LIMIT | mjDSBL_CONTACT | mjDSBL_FRICTIONLOSS | mjDSBL_ACTUATION;
    data_.reset(mj_makeData(model_.get()));
  }

  Robot robot_ = test::panda_with_bodies();
  std::unique_ptr<mjModel, void (*)(mjModel*)> model_{nullptr, &mj_deleteModel};
  std::unique_ptr<mjData, void (*)(mjData*)> data_{nullptr, &mj_deleteData};
};

TEST_F(Mujoco, AcceleratesAsThePlant) {
  Plant plant(robot_);
  double worst = 0.0;
  for (unsigned seed = 0; seed < 10000; ++seed) {
    std::mt19937_64 random(seed);
    const VectorXd q = random_vector(random, 7, 2.5), dq = random_vector(random, 7, 2.0),
                   tau = random_vector(random, 7, 20.0);
    plant.reset(q, dq, tau);
    Eigen::Map<VectorXd>(data_->qpos, 7) = q;
    Eigen::Map<VectorXd>(data_->qvel, 7) = dq;
    Eigen::Map<VectorXd>(data_->qfrc_applied, 7) = tau;
    mj_forward(model_.get(), data_.get());
    const VectorXd theirs = Eigen::Map<VectorXd>(data_->qacc, 7);
    const double error = (plant.ddq() - theirs).norm() / theirs.norm();
    worst = std::max(worst, error);
    ASSERT_LE(error, 1e-8) << "seed " << seed;
  }
  std::printf("  %.1e relative\n", worst);
}

TEST_F(Mujoco, MovesAsThePlant) {
  const double h = 0.25e-3;
  PlantOptions options;
  options.interpolate_torque = false;
  Plant plant(robot_, options);
  model_->opt.timestep = h;
  model_->opt.integrator = mjINT_RK4;
  double worst = 0.0, moved = 0.0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    std::mt19937_64 random(seed);
    const VectorXd q = random_vector(random, 7, 1.5), size = random_vector(random, 7, 3.0);
    plant.reset(q, VectorXd::Zero(7));
    mj_resetData(model_.get(), data_.get());
    Eigen::Map<VectorXd>(data_->qpos, 7) = q;
    for (int k = 0; k < 4000; ++k) {
      const VectorXd tau = size * std::sin(10.0 * k * h);
      Eigen::Map<VectorXd>(data_->qfrc_applied, 7) = tau;
      mj_step(model_.get(), data_.get());
      plant.step(tau, h);
    }
    const VectorXd theirs = Eigen::Map<VectorXd>(data_->qpos, 7);
    worst = std::max(worst, (plant.q() - theirs).cwiseAbs().maxCoeff());
    moved = std::max(moved, (plant.q() - q).cwiseAbs().maxCoeff());
    EXPECT_LT((plant.q() - theirs).cwiseAbs().maxCoeff(), 1e-3) << "seed " << seed;
  }
  std::printf("  %.1e rad after 1 s (it moved by %.1f rad)\n", worst, moved);
}

#else

TEST(Mujoco, AcceleratesAsThePlant) { GTEST_SKIP() << "built without MuJoCo"; }

#endif

}  // namespace
}  // namespace dynid
