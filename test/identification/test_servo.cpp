// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/servo.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <set>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/forward_dynamics.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

using P = ServoParameter;

/// A command that sweeps, rests and reverses: sums of sines under a slow gate, held between its stamps.
Eigen::VectorXd command(const Eigen::VectorXd& t, unsigned seed, double amplitude) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * M_PI), frequency(0.15, 2.5);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(t.size());
  for (int k = 0; k < 5; ++k) {
    const double w = 2.0 * M_PI * frequency(random), p = phase(random);
    u.array() += amplitude / 3.0 * (w * t.array() + p).sin();
  }
  const double slow = 2.0 * M_PI * 0.08, p = phase(random);
  return u.array() * (0.6 + 0.4 * (slow * t.array() + p).sin());
}

Eigen::VectorXd stamps(Eigen::Index n, double rate) {
  return Eigen::VectorXd::LinSpaced(n, 0.0, double(n - 1) / rate);
}

/// The joint's motion with many steps for each stamp.
Eigen::VectorXd motion(const ServoJoint& joint, const Eigen::VectorXd& t, const Eigen::VectorXd& u,
                       int steps) {
  const HeldCommand held(t, u);
  ServoState<false> state(u[0] - joint.bias, 0.0, u[0]);
  Eigen::Index hint = 0;
  ServoInput in;
  Eigen::VectorXd q(t.size());
  for (Eigen::Index i = 0; i < t.size(); ++i) {
    q[i] = state.q;
    if (i + 1 == t.size()) break;
    const double h = (t[i + 1] - t[i]) / steps;
    for (int k = 0; k < steps; ++k) {
      held.fill(t[i] + k * h, h, joint.delay, hint, in);
      state.step(joint, in);
    }
  }
  return q;
}

ServoJoint random_joint(std::mt19937_64& random) {
  const auto between = [&](double low, double high) {
    return low * std::pow(high / low, std::uniform_real_distribution<double>()(random));
  };
  ServoJoint joint;
  const double w = between(12.0, 30.0);
  joint.inertia = 1.0 / (w * w);
  joint.damping = 2.0 * between(0.5, 1.2) / w;
  joint.coulomb = between(0.005, 0.03);
  joint.bias = between(0.005, 0.05);
  joint.delay = between(0.015, 0.06);
  return joint;
}

/// `joints` in parallel, each with white noise [rad] on its position.
Log servo_log(const std::vector<ServoJoint>& joints, unsigned seed, double noise, Eigen::Index samples = 1500,
              double rate = 50.0) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Log log;
  log.source = "servos " + std::to_string(seed);
  log.t = stamps(samples, rate);
  log.u.resize(samples, static_cast<Eigen::Index>(joints.size()));
  log.q = log.u;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    log.u.col(c) = command(log.t, seed * 101 + static_cast<unsigned>(j), 0.3);
    log.q.col(c) = motion(joints[j], log.t, log.u.col(c), 32);
    for (Eigen::Index i = 0; i < samples; ++i) log.q(i, c) += noise * normal(random);
  }
  return log;
}

double truth(const ServoJoint& joint, const std::string& name) {
  if (name == "natural_frequency") return 1.0 / std::sqrt(joint.inertia);
  if (name == "damping_ratio") return 0.5 * joint.damping / std::sqrt(joint.inertia);
  if (name == "coulomb_position") return joint.coulomb;
  if (name == "delay") return joint.delay;
  if (name == "bias") return joint.bias;
  return std::nan("");
}

TEST(ServoJoint, SticksExactlyInsideItsFriction) {
  ServoJoint joint;
  joint.inertia = 0.003, joint.damping = 0.05, joint.coulomb = 0.02;
  ServoState<false> state(0.1, 0.0, 0.0);
  ServoInput in;
  in.h = 0.005;
  for (int k = 0; k < 1000; ++k) {
    in.command = 0.1 + 0.0199 * std::sin(0.05 * k);
    state.step(joint, in);
    ASSERT_EQ(state.q, 0.1);
    ASSERT_EQ(state.v, 0.0);
  }
  in.command = 0.1 + 0.0201;
  state.step(joint, in);
  EXPECT_GT(state.q, 0.1);
}

TEST(ServoJoint, SensitivitiesAreTheDerivativesOfTheMotion) {
  ServoJoint joint;
  joint.inertia = 0.0025, joint.damping = 0.06, joint.coulomb = 0.012, joint.bias = 0.01, joint.delay = 0.023;
  joint.stribeck = 0.006, joint.stribeck_velocity = 0.2, joint.load_friction = 0.1, joint.compliance = 0.05;
  joint.limit = 0.08, joint.command_lag = 0.01, joint.spring = 0.1, joint.backlash = 0.004;
  joint.gravity_compensation = 0.3;
  const Eigen::VectorXd t = stamps(400, 50.0), u = command(t, 3, 0.5);
  const HeldCommand held(t, u);
  const auto run = [&](const ServoJoint& p, auto& state) {
    Eigen::Index hint = 0;
    ServoInput in;
    for (Eigen::Index i = 0; i + 1 < t.size(); ++i)
      for (int k = 0; k < 4; ++k) {
        held.fill(t[i] + 0.005 * k, 0.005, p.delay, hint, in);
        in.inertia = 0.01 + 0.005 * std::sin(0.7 * t[i]);
        in.load = 0.4 * std::cos(1.1 * t[i]);
        in.gravity = 0.3 * std::cos(1.1 * t[i]);
        state.step(p, in);
      }
  };
  ServoState<true> exact(0.0, 0.0, u[0]);
  run(joint, exact);
  for (int k = 0; k < servo_parameters; ++k) {
    const auto p = static_cast<P>(k);
    const double step = 1e-6 * joint[p];
    ServoJoint up = joint, down = joint;
    up[p] += step, down[p] -= step;
    ServoState<false> above(0.0, 0.0, u[0]), below(0.0, 0.0, u[0]);
    run(up, above);
    run(down, below);
    const double slope = (above.q - below.q) / (2.0 * step);
    EXPECT_NEAR(exact.dq[k], slope, 2e-4 * (std::abs(slope) + 1e-3)) << "parameter " << k;
  }
}

TEST(ServoJoint, PartsOfTheLoadHaveDerivativesToo) {
  ServoJoint joint;
  joint.inertia = 0.0025, joint.damping = 0.06, joint.coulomb = 0.012, joint.compliance = 0.05;
  joint.load_friction = 0.1;
  const Eigen::VectorXd t = stamps(400, 50.0), u = command(t, 3, 0.5);
  const HeldCommand held(t, u);
  const auto run = [&](const std::array<double, 2>& factors, auto& state) {
    Eigen::Index hint = 0;
    ServoInput in;
    for (Eigen::Index i = 0; i + 1 < t.size(); ++i)
      for (int k = 0; k < 4; ++k) {
        held.fill(t[i] + 0.005 * k, 0.005, 0.0, hint, in);
        const double part[] = {0.2 * std::cos(1.3 * t[i]), 0.1};
        in.load = 0.4 * std::cos(1.1 * t[i]) + factors[0] * part[0] + factors[1] * part[1];
        state.step(joint, in, part);
      }
  };
  ServoState<true, 2> exact(0.0, 0.0, u[0]);
  run({0.3, -0.2}, exact);
  for (std::size_t k = 0; k < 2; ++k) {
    const double step = 1e-6;
    std::array<double, 2> up = {0.3, -0.2}, down = up;
    up[k] += step, down[k] -= step;
    ServoState<false, 2> above(0.0, 0.0, u[0]), below(0.0, 0.0, u[0]);
    run(up, above);
    run(down, below);
    const double slope = (above.q - below.q) / (2.0 * step);
    EXPECT_NEAR(exact.dq[servo_parameters + static_cast<int>(k)], slope, 2e-4 * (std::abs(slope) + 1e-3));
  }
}

TEST(ServoJoint, ConvergesWithTheStep) {
  std::mt19937_64 random(5);
  const ServoJoint joint = random_joint(random);
  const Eigen::VectorXd t = stamps(1000, 50.0), u = command(t, 8, 0.4);
  const Eigen::VectorXd exact = motion(joint, t, u, 256);
  const double coarse = (motion(joint, t, u, 4) - exact).cwiseAbs().mean();
  const double fine = (motion(joint, t, u, 16) - exact).cwiseAbs().mean();
  EXPECT_LT(coarse, 0.01 * (u - exact).cwiseAbs().mean());
  EXPECT_LT(fine, 0.5 * coarse);
}

TEST(IdentifyServos, IntervalsHoldTheTruthAsOftenAsTheySay) {
  std::mt19937_64 random(11);
  std::vector<ServoJoint> joints;
  for (int j = 0; j < 24; ++j) joints.push_back(random_joint(random));
  std::vector<Log> logs;
  for (unsigned k = 1; k <= 3; ++k) logs.push_back(servo_log(joints, k, 1e-3));
  ServoOptions options;
  options.further_terms = false;
  const ServoIdentification id = identify_servos(logs, {}, options);
  int held = 0, all = 0;
  for (std::size_t j = 0; j < joints.size(); ++j)
    for (const ServoValue& v : id.joints[j].values) {
      const double is = truth(joints[j], v.name);
      ASSERT_FALSE(std::isnan(is)) << v.name;
      EXPECT_NEAR(v.value, is, 0.1 * std::abs(is)) << "joint " << j + 1 << " " << v.name;
      held += v.low <= is && is <= v.high;
      ++all;
    }
  EXPECT_EQ(all, 120);
  EXPECT_GE(held, 0.85 * all);
  EXPECT_LE(held, 0.95 * all);
  // What it was identified from, it reproduces: what is left is the noise.
  for (const Log& log : logs) {
    const ServoReplay replay = replay_servos(id.robot, log);
    EXPECT_LT(replay.error.maxCoeff(), 1.2e-3);
  }
}

// Motions unlike each other, as a person records them, on an encoder with steps: what one log alone says of a
// parameter is not said by several.
TEST(IdentifyServos, IntervalsHoldTheTruthWhereLogsAreUnlikeEachOther) {
  constexpr double step = 1.5e-3;
  std::mt19937_64 random(17);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const Eigen::VectorXd t = stamps(1500, 50.0);
  const auto waves = [&](double amplitude, double slowest, double fastest) {
    Eigen::VectorXd u = Eigen::VectorXd::Zero(t.size());
    for (int k = 0; k < 6; ++k) {
      const double w = 2.0 * M_PI * between(slowest, fastest), p = between(0.0, 2.0 * M_PI);
      u.array() += amplitude / 3.0 * (w * t.array() + p).sin();
    }
    return u;
  };
  const auto steps = [&](double amplitude) {
    Eigen::VectorXd u(t.size());
    double to = 0.0;
    for (Eigen::Index i = 0, next = 0; i < t.size(); ++i) {
      if (i == next) {
        to = between(-amplitude, amplitude);
        next += static_cast<Eigen::Index>(between(40.0, 120.0));
      }
      u[i] = to;
    }
    return u;
  };
  std::vector<ServoJoint> joints;
  for (int j = 0; j < 24; ++j) joints.push_back(random_joint(random));
  std::vector<Log> logs(4);
  for (std::size_t l = 0; l < logs.size(); ++l) {
    Log& log = logs[l];
    log.source = "motion " + std::to_string(l);
    log.t = t;
    log.u.resize(t.size(), static_cast<Eigen::Index>(joints.size()));
    log.q = log.u;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const auto c = static_cast<Eigen::Index>(j);
      log.u.col(c) = l == 0   ? waves(0.4, 0.03, 0.15)
                     : l == 1 ? waves(0.1, 0.8, 2.5)
                     : l == 2 ? steps(0.4)
                              : waves(0.3, 0.1, 0.8);
      log.q.col(c) = motion(joints[j], t, log.u.col(c), 32).unaryExpr([](double q) {
        return step * std::round(q / step);
      });
    }
  }
  ServoOptions options;
  options.further_terms = false;
  const ServoIdentification id = identify_servos(logs, {}, options);
  int held = 0, all = 0;
  for (std::size_t j = 0; j < joints.size(); ++j)
    for (const ServoValue& v : id.joints[j].values) {
      const double is = truth(joints[j], v.name);
      held += v.low <= is && is <= v.high;
      ++all;
    }
  EXPECT_EQ(all, 120);
  EXPECT_GE(held, 0.86 * all);  // by the scores of the logs alone some three quarters
}

// A model that is not the robot's to the last: every motion is moved by other numbers. An interval holds what
// as many other motions give.
TEST(IdentifyServos, IntervalsHoldWhatOtherMotionsGive) {
  std::mt19937_64 random(29);
  std::normal_distribution<double> normal;
  std::vector<ServoJoint> joints;
  for (int j = 0; j < 24; ++j) joints.push_back(random_joint(random));
  ServoOptions options;
  options.further_terms = false;
  std::array<ServoIdentification, 2> halves;
  for (unsigned half = 0; half < 2; ++half) {
    std::vector<Log> logs;
    for (unsigned l = 0; l < 8; ++l) {
      std::vector<ServoJoint> there = joints;
      for (ServoJoint& joint : there)
        for (double* value : {&joint.inertia, &joint.damping, &joint.coulomb, &joint.bias, &joint.delay})
          *value *= std::exp(0.15 * normal(random));
      logs.push_back(servo_log(there, 100 * half + l + 1, 1e-3, 600));
    }
    halves[half] = identify_servos(logs, {}, options);
  }
  int held = 0, all = 0;
  for (std::size_t j = 0; j < joints.size(); ++j)
    for (std::size_t k = 0; k < halves[0].joints[j].values.size(); ++k) {
      const ServoValue &a = halves[0].joints[j].values[k], &b = halves[1].joints[j].values[k];
      held += a.low <= b.value && b.value <= a.high;
      held += b.low <= a.value && a.value <= b.high;
      all += 2;
    }
  EXPECT_EQ(all, 240);
  EXPECT_GE(held, 0.83 * all);
  EXPECT_LE(held, 0.97 * all);
}

TEST(IdentifyServos, NeitherThreadsNorNumberingOfJointsMatter) {
  std::mt19937_64 random(23);
  std::vector<ServoJoint> joints = {random_joint(random), random_joint(random), random_joint(random)};
  std::vector<Log> logs = {servo_log(joints, 4, 1e-3, 800), servo_log(joints, 5, 1e-3, 800)};
  const ServoIdentification one = [&] {
    const tbb::global_control single(tbb::global_control::max_allowed_parallelism, 1);
    return identify_servos(logs);
  }();
  for (Log& log : logs) {
    log.u = log.u.rowwise().reverse().eval();
    log.q = log.q.rowwise().reverse().eval();
  }
  const ServoIdentification other = identify_servos(logs);
  for (std::size_t j = 0; j < 3; ++j) {
    const ServoFit &a = one.joints[j], &b = other.joints[2 - j];
    ASSERT_EQ(a.values.size(), b.values.size());
    for (std::size_t k = 0; k < a.values.size(); ++k) {
      EXPECT_EQ(a.values[k].value, b.values[k].value) << a.values[k].name;
      EXPECT_EQ(a.values[k].low, b.values[k].low) << a.values[k].name;
    }
  }
}

/// Two links of known mass in a vertical plane, a servo at each joint, integrated with the forward dynamics
/// and a friction smoothed over a speed a thousandth of the motion's: not the scheme that identifies it.
Robot pendulum() {
  Robot robot;
  robot.name = "pendulum";
  for (int j = 0; j < 2; ++j) {
    Joint joint =
        make_joint("joint" + std::to_string(j + 1), JointType::continuous, {j == 0 ? 0.0 : 0.3, 0, 0, 0});
    LinkInertia link;
    link.mass = 0.8 - 0.3 * j;
    link.com = Eigen::Vector3d(0.15, 0.0, 0.0);
    link.inertia = Eigen::Vector3d(2e-4, 6e-3, 6e-3).asDiagonal();
    joint.parameters = to_standard(link);
    robot.joints.push_back(joint);
  }
  robot.gravity = Eigen::Vector3d(-9.81, 0.0, 0.0);
  return robot;
}

Log pendulum_log(const Robot& robot, const Eigen::Vector2d& kp, const Eigen::Vector2d& kd, double armature,
                 double coulomb, double delay, unsigned seed) {
  constexpr double h = 2e-4;
  constexpr int steps = 100;
  Log log;
  log.source = "pendulum " + std::to_string(seed);
  log.t = stamps(1500, 50.0);
  log.u.resize(log.t.size(), 2);
  log.q = log.u;
  for (int j = 0; j < 2; ++j) log.u.col(j) = command(log.t, seed * 7 + static_cast<unsigned>(j), 1.2);
  const Model<2> model(robot);
  Workspace<2> ws(model);
  Eigen::Vector2d q = log.u.row(0).transpose(), v = Eigen::Vector2d::Zero(), tau, a;
  const Eigen::Vector2d rotors = Eigen::Vector2d::Constant(armature);
  std::vector<HeldCommand> held = {{log.t, log.u.col(0)}, {log.t, log.u.col(1)}};
  Eigen::Index hint[2] = {0, 0};
  for (Eigen::Index i = 0; i < log.t.size(); ++i) {
    log.q.row(i) = q.transpose();
    for (int k = 0; k < steps; ++k) {
      for (int j = 0; j < 2; ++j) {
        const double u = held[static_cast<std::size_t>(j)].at(log.t[i] + k * h - delay, hint[j]);
        tau[j] = kp[j] * (u - q[j]) - kd[j] * v[j] - coulomb * std::tanh(v[j] / 2e-3);
      }
      forward_dynamics(model, ws, q, v, tau, a, rotors);
      v += h * a;
      q += h * v;
    }
  }
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (double& x : log.q.reshaped()) x += 2e-4 * normal(random);
  return log;
}

TEST(IdentifyServos, StiffnessOfAPendulumOfKnownMassesIsInSi) {
  const Robot robot = pendulum();
  const Eigen::Vector2d kp(14.0, 6.0), kd(0.8, 0.3);
  std::vector<Log> logs;
  for (unsigned seed = 1; seed <= 3; ++seed)
    logs.push_back(pendulum_log(robot, kp, kd, 0.01, 0.05, 0.02, seed));
  const ServoIdentification id = identify_servos(logs, robot);
  for (int j = 0; j < 2; ++j) {
    const ServoFit& fit = id.joints[static_cast<std::size_t>(j)];
    ASSERT_TRUE(fit.si) << "joint " << j + 1;
    EXPECT_NEAR(id.robot.joints[static_cast<std::size_t>(j)].servo->kp, kp[j], 0.02 * kp[j]);
    EXPECT_NEAR(id.robot.joints[static_cast<std::size_t>(j)].servo->kd, kd[j], 0.05 * kd[j]);
    // A third of the joint's inertia, which the delay hides in part.
    EXPECT_NEAR(id.robot.joints[static_cast<std::size_t>(j)].rotor_inertia, 0.01, 0.005);
  }
  // The coupled motion of a command that took no part.
  const Log other = pendulum_log(robot, kp, kd, 0.01, 0.05, 0.02, 9);
  const ServoReplay replay = replay_servos(id.robot, other);
  const Eigen::VectorXd tracking = (other.u - other.q).cwiseAbs().colwise().mean().transpose();
  for (int j = 0; j < 2; ++j) EXPECT_LT(replay.error[j], 0.02 * tracking[j]) << "joint " << j + 1;
  // And through the file.
  const Robot read = parse_model(to_yaml({id.robot, {}, ""}), "pendulum.yaml").robot;
  EXPECT_NEAR((replay_servos(read, other).q - replay.q).cwiseAbs().maxCoeff(), 0.0, 1e-9);
}

std::string refusal(const std::vector<Log>& logs, const std::optional<Robot>& robot = {}) {
  try {
    identify_servos(logs, robot);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(IdentifyServos, NamesWhatIsWrongWithALog) {
  std::mt19937_64 random(31);
  const std::vector<ServoJoint> joints = {random_joint(random), random_joint(random)};
  const Log good = servo_log(joints, 6, 1e-3, 600);

  Log bad = good;
  bad.u.resize(0, 0);
  EXPECT_NE(refusal({bad}).find("columns u1..u2 are missing"), std::string::npos);

  bad = good;
  bad.u *= 180.0 / M_PI;
  EXPECT_NE(refusal({bad}).find("the commands u move"), std::string::npos);

  bad = good;
  bad.q *= 180.0 / M_PI;
  EXPECT_NE(refusal({bad}).find("the positions q move"), std::string::npos);

  bad = good;
  bad.u *= 180.0 / M_PI, bad.q *= 180.0 / M_PI;
  Robot robot = pendulum();
  for (Joint& joint : robot.joints) {
    joint.type = JointType::revolute;
    joint.limits.lower = -1.5, joint.limits.upper = 1.5;
  }
  EXPECT_NE(refusal({bad}, robot).find("in degrees"), std::string::npos);

  bad = good;
  bad.u.rowwise() = good.u.row(0).eval();
  EXPECT_NE(refusal({bad}).find("no command moves"), std::string::npos);

  bad = good;
  bad.u.col(0).setConstant(0.1);
  ServoOptions quick;
  quick.further_terms = false;
  const ServoIdentification half = identify_servos({bad}, {}, quick);
  EXPECT_FALSE(half.joints[0].identified);
  EXPECT_TRUE(half.joints[1].identified);
  EXPECT_FALSE(half.robot.joints[0].servo);
  EXPECT_THROW(replay_servos(half.robot, bad), Error);
}

TEST(IdentifyServos, SaysWhereCommandsComeAfterTheMotion) {
  ServoJoint joint;
  joint.inertia = 1.0 / 400.0, joint.damping = 0.08, joint.coulomb = 0.01, joint.delay = 0.005;
  Log log = servo_log({joint}, 7, 1e-3, 1500);
  const Eigen::Index n = log.t.size();
  log.u.bottomRows(n - 2) = log.u.topRows(n - 2).eval();  // stamped two rows late
  ServoOptions quick;
  quick.further_terms = false;
  const ServoIdentification id = identify_servos({log}, {}, quick);
  const auto& remarks = id.joints[0].remarks;
  EXPECT_TRUE(std::any_of(remarks.begin(), remarks.end(),
                          [](const std::string& text) { return text.find("earlier") != std::string::npos; }));
}

/// The recorded hobby arm: three motions fitted, the others in open loop.
TEST(IdentifyServos, RecordedHobbyArmOnMotionsLeftOut) {
  const char* data = std::getenv("DYNID_DATA");
  if (!data) GTEST_SKIP() << "DYNID_DATA is not set";
  const std::filesystem::path folder = std::filesystem::path(data) / "so101_real";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const std::set<std::string> fitted = {"chirp_sweep", "multisine", "friction_gravity"};
  LogColumns columns;
  columns.dq = columns.tau = false;
  std::vector<Log> logs, others;
  std::set<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".csv") files.insert(entry.path());
  for (const auto& file : files)
    (fitted.count(file.stem().string()) ? logs : others).push_back(read_log(file.string(), 0, columns));
  ASSERT_EQ(logs.size(), 3u);
  ASSERT_EQ(others.size(), 27u);
  const ServoIdentification id = identify_servos(logs);
  Eigen::VectorXd error = Eigen::VectorXd::Zero(6);
  for (const Log& log : others) error += replay_servos(id.robot, log).error / double(others.size());
  EXPECT_LE(error.mean(), 5.0e-3) << error.transpose();
  EXPECT_LE(error.maxCoeff(), 8.5e-3) << error.transpose();
}

}  // namespace
}  // namespace dynid
