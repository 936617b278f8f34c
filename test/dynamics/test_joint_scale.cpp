// SPDX-License-Identifier: Apache-2.0
// A joint's scale goes with the joint: masses, lengths and units change it by its dimension and no more.
#include "dynid/dynamics/joint_scale.hpp"

#include <gtest/gtest.h>

#include <cstdio>

#include "chains.hpp"

namespace dynid {
namespace {

using Eigen::MatrixXd;

/// A chain with joints of every type, some limits unknown.
Robot chain(unsigned seed) {
  test::Generator random(seed);
  Robot robot;
  const int n = 1 + static_cast<int>(seed % 7);
  for (int i = 0; i < n; ++i) {
    Joint joint;
    joint.name = "joint" + std::to_string(i + 1);
    joint.link_name = "link" + std::to_string(i + 1);
    joint.type = static_cast<JointType>(random() % 3);
    joint.origin.translation() = test::random_vector(random, 0.4);
    joint.origin.linear() = test::random_rotation(random);
    joint.parameters = test::random_body(random);
    joint.rotor_inertia = test::uniform(random, 0.0, 0.3);
    if (joint.type != JointType::continuous && random() % 2 == 0) {
      joint.limits.lower = test::uniform(random, -2.0, -0.5);
      joint.limits.upper = test::uniform(random, 0.5, 2.0);
    }
    if (random() % 2 == 0) joint.limits.velocity = test::uniform(random, 0.5, 3.0);
    if (random() % 2 == 0) joint.limits.acceleration = test::uniform(random, 2.0, 8.0);
    robot.joints.push_back(joint);
  }
  robot.tip.translation() = test::random_vector(random, 0.2);
  return robot;
}

struct Motion {
  MatrixXd q, dq, ddq;
};
Motion motion_of(const Robot& robot, unsigned seed) {
  test::Generator random(seed + 1000);
  const Eigen::Index n = robot.size();
  Motion m = {MatrixXd(50, n), MatrixXd(50, n), MatrixXd(50, n)};
  for (Eigen::Index i = 0; i < 50; ++i) {
    m.q.row(i) = test::random_state(random, int(n), 1.0);
    m.dq.row(i) = test::random_state(random, int(n), 1.5);
    m.ddq.row(i) = test::random_state(random, int(n), 3.0);
  }
  return m;
}

/// The chain in units a `mass`th, a `length`th and a `time`th as large.
Robot scaled(Robot robot, double mass, double length, double time) {
  for (Joint& joint : robot.joints) {
    const double unit = joint.type == JointType::prismatic ? length : 1.0;
    joint.origin.translation() *= length;
    joint.parameters[0] *= mass;
    joint.parameters.segment<3>(1) *= mass * length;
    joint.parameters.tail<6>() *= mass * length * length;
    joint.rotor_inertia *= joint.type == JointType::prismatic ? mass : mass * length * length;
    joint.limits.lower *= unit;
    joint.limits.upper *= unit;
    joint.limits.velocity *= unit / time;
    joint.limits.acceleration *= unit / (time * time);
  }
  robot.tip.translation() *= length;
  robot.gravity *= length / (time * time);
  return robot;
}

void expect_scaled(const std::vector<JointScale>& a, const std::vector<JointScale>& b, double mass,
                   double length, double time, const char* what) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t j = 0; j < a.size(); ++j) {
    const bool slides = a[j].type == JointType::prismatic;
    const double unit = slides ? length : 1.0;                   // of a position
    const double work = mass * length * length / (time * time);  // of an energy
    const auto near = [&](double x, double y, double by, const char* field) {
      EXPECT_NEAR(y / (x * by), 1.0, 1e-9) << what << ": " << field << " of joint " << j + 1;
    };
    near(a[j].torque, b[j].torque, work / unit, "torque");
    near(a[j].gravity, b[j].gravity, work / unit, "gravity");
    near(a[j].inertia, b[j].inertia, work * time * time / (unit * unit), "inertia");
    near(a[j].speed, b[j].speed, unit / time, "speed");
    near(a[j].acceleration, b[j].acceleration, unit / (time * time), "acceleration");
    near(a[j].travel, b[j].travel, unit, "travel");
    near(a[j].stiffness(), b[j].stiffness(), work / (unit * unit), "stiffness");
    near(a[j].damping(), b[j].damping(), work * time / (unit * unit), "damping");
  }
}

TEST(JointScale, GoesWithMassesLengthsAndUnits) {
  struct Factors {
    double mass, length, time;
    const char* what;
  };
  for (const Factors& f : {Factors{8.0, 1.0, 1.0, "masses x 8"}, Factors{0.05, 1.0, 1.0, "masses x 0.05"},
                           Factors{1.0, 3.0, std::sqrt(3.0), "lengths x 3 under the same gravity"},
                           Factors{1.0, 1000.0, 1.0, "mm"}, Factors{1000.0, 1.0, 60.0, "g and minutes"}}) {
    for (unsigned seed = 0; seed < 60; ++seed) {
      const Robot robot = chain(seed), other = scaled(robot, f.mass, f.length, f.time);
      expect_scaled(joint_scales(robot), joint_scales(other), f.mass, f.length, f.time, f.what);
      Motion m = motion_of(robot, seed);
      const auto a = joint_scales(robot, m.q, m.dq, m.ddq, {}, 0.01);
      for (int j = 0; j < robot.size(); ++j) {
        const double unit =
            robot.joints[static_cast<std::size_t>(j)].type == JointType::prismatic ? f.length : 1.0;
        m.q.col(j) *= unit, m.dq.col(j) *= unit / f.time, m.ddq.col(j) *= unit / (f.time * f.time);
      }
      expect_scaled(a, joint_scales(other, m.q, m.dq, m.ddq, {}, 0.01 * f.time), f.mass, f.length, f.time,
                    f.what);
      if (HasFailure()) FAIL() << "seed " << seed;
    }
  }
}

TEST(JointScale, IsPositiveAndFiniteWhateverTheRobot) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    Robot robot = chain(seed);
    if (seed % 3 == 0) robot.joints.back().parameters.setZero(), robot.joints.back().rotor_inertia = 0.0;
    if (seed % 5 == 0) robot.gravity.setZero();
    Motion m = motion_of(robot, seed);
    if (seed % 2 == 0) m.dq.setZero(), m.ddq.setZero(), m.q.rowwise() = m.q.row(0).eval();
    const MatrixXd none = seed % 4 == 0 ? MatrixXd::Zero(50, robot.size()) : MatrixXd();
    for (const auto& scales : {joint_scales(robot), joint_scales(robot, m.q, m.dq, m.ddq, none, 0.0)}) {
      for (const JointScale& s : scales)
        for (const double x : {s.torque, s.gravity, s.speed, s.acceleration, s.travel, s.inertia})
          ASSERT_TRUE(x > 0.0 && std::isfinite(x)) << "seed " << seed;
    }
  }
}

TEST(JointScale, NamesDoNotMatterAndItIsTheSameAtEveryCall) {
  const Robot robot = chain(6);
  Robot other = robot;
  std::swap(other.joints[0].name, other.joints[4].name);
  std::swap(other.joints[1].link_name, other.joints[2].link_name);
  const auto a = joint_scales(robot), b = joint_scales(other);
  for (std::size_t j = 0; j < a.size(); ++j) {
    EXPECT_EQ(a[j].torque, b[j].torque);
    EXPECT_EQ(a[j].inertia, b[j].inertia);
    EXPECT_EQ(a[j].type, robot.joints[j].type);
  }
}

TEST(JointScale, ModelAndMotionAgreeForThePanda) {
  // Within a factor of three, along a motion that uses the limits.
  const Robot robot = test::panda();
  const auto model = joint_scales(robot);
  test::Generator random(1);
  MatrixXd q(400, 7), dq(400, 7), ddq(400, 7);
  for (int j = 0; j < 7; ++j) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    const double middle = 0.5 * (limits.lower + limits.upper), swing = 0.4 * (limits.upper - limits.lower);
    const double w = limits.velocity / swing, phase = test::uniform(random, 0.0, 6.0);
    for (int i = 0; i < 400; ++i) {
      const double x = w * 0.05 * i + phase;
      q(i, j) = middle + swing * std::sin(x);
      dq(i, j) = swing * w * std::cos(x);
      ddq(i, j) = -swing * w * w * std::sin(x);
    }
  }
  const auto motion = joint_scales(robot, q, dq, ddq, {}, 0.05);
  for (std::size_t j = 0; j < 7; ++j) {
    std::printf("  joint %zu: torque %.3g %.3g, inertia %.3g %.3g, speed %.3g %.3g, travel %.3g %.3g\n",
                j + 1, model[j].torque, motion[j].torque, model[j].inertia, motion[j].inertia, model[j].speed,
                motion[j].speed, model[j].travel, motion[j].travel);
    const std::pair<double, double> pairs[] = {{model[j].torque, motion[j].torque},
                                               {model[j].inertia, motion[j].inertia},
                                               {model[j].speed, motion[j].speed},
                                               {model[j].acceleration, motion[j].acceleration},
                                               {model[j].travel, motion[j].travel}};
    for (const auto& [a, b] : pairs) {
      EXPECT_LT(a, 3.0 * b) << "joint " << j + 1;
      EXPECT_LT(b, 3.0 * a) << "joint " << j + 1;
    }
  }
}

TEST(JointScale, UnitsByType) {
  EXPECT_EQ(joint_units(JointType::continuous).stiffness, "N m/rad");
  EXPECT_EQ(joint_units(JointType::prismatic).stiffness, "N/m");
  EXPECT_EQ(unit_for(JointType::prismatic, "N m s/rad"), "N s/m");
  EXPECT_EQ(unit_for(JointType::prismatic, "kg m^2"), "kg");
  EXPECT_EQ(unit_for(JointType::prismatic, "s"), "s");
  EXPECT_EQ(unit_for(JointType::revolute, "N m"), "N m");
  const JointScale s = joint_scales(chain(6)).front();
  EXPECT_DOUBLE_EQ(s.of("N m s/rad"), s.torque / s.speed);
  EXPECT_DOUBLE_EQ(s.of("N s/m"), s.of("N m s/rad"));
  EXPECT_DOUBLE_EQ(s.of("1"), 1.0);
  EXPECT_THROW(s.of("furlong"), Error);
}

}  // namespace
}  // namespace dynid
