// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <ctime>
#include <map>
#include <random>
#include <set>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/effect/catalogue.hpp"
#include "dynid/friction/friction.hpp"
#include "dynid/identification/conventions.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/perturbed.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"
#include "model/random_robot.hpp"
#include "sanitized.hpp"

namespace dynid {
namespace {

constexpr double pi = 3.14159265358979323846;
using test::Random;
using test::uniform;

// ---------------------------------------------------------------------------------------------- robots

Joint link(const std::string& name, JointType type, const ModifiedDh& dh, double mass,
           const Eigen::Vector3d& com, const Eigen::Vector3d& half) {
  Joint joint = make_joint(name, type, dh);
  const Eigen::Vector3d second = mass * half.cwiseAbs2() / 3.0;
  joint.parameters = to_standard(
      {mass, com, Eigen::Matrix3d((Eigen::Vector3d::Constant(second.sum()) - second).asDiagonal())});
  joint.limits.velocity = 2.0;
  joint.limits.acceleration = 8.0;
  joint.limits.lower = -2.6;
  joint.limits.upper = 2.6;
  return joint;
}

/// A six-joint arm of the UR family, `size` times as long and `weight` times as heavy as a UR10e.
Robot six_joints(const std::string& name, double size, double weight) {
  Robot robot;
  robot.name = name;
  const double s = size, w = weight;
  const auto add = [&](const char* joint, ModifiedDh dh, double mass, Eigen::Vector3d com,
                       Eigen::Vector3d half) {
    dh.a *= s, dh.d *= s;
    robot.joints.push_back(link(joint, JointType::revolute, dh, w * mass, s * com, s * half));
  };
  add("shoulder_pan", {0, 0, 0.1807, 0}, 7.369, {0.02, 0, 0.027}, {0.06, 0.06, 0.08});
  add("shoulder_lift", {0, pi / 2, 0, 0}, 13.051, {-0.23, 0, 0.158}, {0.3, 0.06, 0.06});
  add("elbow", {-0.6127, 0, 0, 0}, 3.989, {-0.375, 0, 0.042}, {0.27, 0.05, 0.05});
  add("wrist_1", {-0.57155, 0, 0.17415, 0}, 2.1, {0.01, -0.02, 0.018}, {0.04, 0.05, 0.05});
  add("wrist_2", {0, pi / 2, 0.11985, 0}, 1.98, {0, 0.018, 0.012}, {0.04, 0.05, 0.05});
  add("wrist_3", {0, -pi / 2, 0.11655, 0}, 0.9, {0.02, 0.012, 0.02}, {0.04, 0.04, 0.03});
  for (Joint& joint : robot.joints) {
    joint.friction.linear.viscous = 3.0 * w * s;
    joint.friction.linear.coulomb = 2.0 * w * s;
    joint.friction.linear.velocity_scale = 0.02;
  }
  for (int j = 3; j < 6; ++j) {
    robot.joints[j].friction.linear.viscous *= 0.1;
    robot.joints[j].friction.linear.coulomb *= 0.1;
  }
  return robot;
}

Robot scara() {
  Robot robot;
  robot.name = "scara";
  robot.joints.push_back(
      link("j1", JointType::revolute, {0, 0, 0.4, 0}, 8.0, {0.2, 0.01, 0}, {0.2, 0.06, 0.05}));
  robot.joints.push_back(
      link("j2", JointType::revolute, {0.4, 0, 0, 0}, 5.0, {0.15, 0, 0.02}, {0.17, 0.05, 0.05}));
  robot.joints.push_back(
      link("z", JointType::prismatic, {0.35, pi, 0, 0}, 1.5, {0, 0, 0.05}, {0.03, 0.03, 0.1}));
  robot.joints.push_back(
      link("roll", JointType::revolute, {0, 0, 0.05, 0}, 1.0, {0.04, 0, 0.02}, {0.05, 0.03, 0.03}));
  robot.joints[2].limits.lower = -0.02;
  robot.joints[2].limits.upper = 0.25;
  robot.joints[2].limits.velocity = 0.8;
  for (Joint& joint : robot.joints) {
    joint.friction.linear.viscous = 0.3;
    joint.friction.linear.coulomb = 0.2;
    joint.friction.linear.velocity_scale = 0.02;
  }
  return robot;
}

Robot one_joint() {
  Robot robot;
  robot.name = "one joint";
  robot.joints.push_back(
      link("swing", JointType::revolute, {0, pi / 2, 0, 0}, 3.0, {0.25, 0.03, 0}, {0.3, 0.03, 0.03}));
  robot.joints[0].friction.linear.viscous = 0.4;
  robot.joints[0].friction.linear.coulomb = 0.3;
  robot.joints[0].friction.linear.velocity_scale = 0.02;
  return robot;
}

std::vector<Robot> robots() {
  return {read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot,
          six_joints("UR10e-like", 1.0, 1.0), scara(), one_joint(), six_joints("heavy", 2.0, 20.0)};
}

// ------------------------------------------------------------------------------------------------- logs

/// What a robot records on a random motion, without a controller: the torque of `plant` with noise.
Log recorded(const Robot& plant, double duration, double rate, unsigned long seed) {
  RandomMotionOptions options;
  options.rate = rate;
  options.base_frequency = 0.1;
  const Trajectory motion = random_motion(plant, duration, seed, options);
  Log log;
  log.source = "simulated";
  log.t = motion.t;
  log.q = motion.q;
  log.dq = motion.dq;
  log.ddq = motion.ddq;
  log.tau = predict_torque(plant, motion.q, motion.dq, motion.ddq).tau;
  Random random(seed);
  std::normal_distribution<double> normal;
  for (int j = 0; j < log.joints(); ++j) {
    const Eigen::VectorXd tau = log.tau.col(j).array() - log.tau.col(j).mean();
    const double noise = 0.02 * std::sqrt(tau.squaredNorm() / double(tau.size()));
    for (double& x : log.tau.col(j)) x += noise * normal(random);
    for (double& x : log.q.col(j)) x += 1e-5 * normal(random);
    for (double& x : log.dq.col(j)) x += 1e-3 * normal(random);
  }
  return log;
}

/// The log as someone with other habits would have written it: apply_conventions() of it gives `log` back.
Log misread(const Assumptions& a, const Robot& robot, Log log) {
  const int n = robot.size();
  if (a.magnitude) log.tau = log.tau.cwiseAbs().eval();
  if (a.without_gravity) {
    const Model<> model(robot);
    Workspace<> ws(model);
    Eigen::VectorXd q(n), g(n);
    for (Eigen::Index i = 0; i < log.samples(); ++i) {
      q = log.q.row(i).transpose();
      gravity(model, ws, q, g);
      log.tau.row(i) -= g.transpose();
    }
  }
  for (int j = 0; j < n; ++j) {
    const bool turns = robot.joints[j].type != JointType::prismatic;
    if (a.torque_factor.size()) log.tau.col(j) /= a.torque_factor[j];
    if (a.torque_sign.size()) log.tau.col(j) *= a.torque_sign[j];
    if (a.zero.size()) log.q.col(j).array() -= a.zero[j];
    if (a.joint_sign.size())
      for (Eigen::MatrixXd* x : {&log.q, &log.dq, &log.ddq, &log.tau})
        if (x->size()) x->col(j) *= a.joint_sign[j];
    if (turns) log.q.col(j) /= a.position_unit;
    log.dq.col(j) /= a.velocity_unit;
    if (log.ddq.size()) log.ddq.col(j) /= a.velocity_unit;
  }
  if (!a.order.empty()) {
    for (Eigen::MatrixXd* x : {&log.q, &log.dq, &log.ddq, &log.tau}) {
      if (!x->size()) continue;
      const Eigen::MatrixXd right = *x;
      for (int j = 0; j < n; ++j) x->col(a.order[j]) = right.col(j);
    }
  }
  log.t /= a.time_unit;
  return log;
}

/// How far the nominal's torque is from the log's under the plain reading, as part of the torque's energy,
/// over the first `joints` (0: all): near zero where a reading makes no difference that can be seen.
double visibility(const Robot& robot, const Log& log, int joints = 0) {
  const Eigen::MatrixXd model = predict_torque(robot, log.q, log.dq, log.ddq).tau;
  if ((model.array().square().colwise().mean() < 0.01 * log.tau.array().square().colwise().mean()).all())
    return 1e9;  // another unit of torque
  Eigen::MatrixXd rest = log.tau - predict_torque(robot, log.q, log.dq, log.ddq).tau;
  double most = 0.0;
  for (int j = 0; j < (joints > 0 ? joints : log.joints()); ++j) {
    const Eigen::VectorXd r = rest.col(j).array() - rest.col(j).mean(),
                          y = log.tau.col(j).array() - log.tau.col(j).mean();
    most = std::max(most, r.squaredNorm() / y.squaredNorm());
  }
  return most;
}

/// A joint's column less what an offset, its own friction and, where it may have one, a rotor can be.
Eigen::VectorXd bare(const Log& log, int k, const Eigen::VectorXd& x, bool rotor = true) {
  Eigen::MatrixXd own(log.samples(), rotor ? 4 : 3);
  const Eigen::ArrayXd v = log.dq.col(k).array();
  own.col(0).setOnes();
  own.col(1) = (v / (0.1 * std::sqrt(v.square().mean()) + 1e-12)).tanh();
  own.col(2) = v;
  if (rotor) own.col(3) = log.ddq.col(k);
  return x - own * own.colPivHouseholderQr().solve(x);
}

/// How far the torque of the nominal's bodies is from the log's under the plain reading, friction and rotors
/// apart, as part of what of the torque is no friction; the largest over the first `joints` (0: all). Below
/// one the model explains something of every joint, and the log is not called misread.
double seen(const Robot& robot, const Log& log, int joints = 0) {
  Robot bodies = robot;
  for (Joint& joint : bodies.joints) joint.friction = {};
  const Eigen::MatrixXd model = predict_torque(bodies, log.q, log.dq, log.ddq).tau;
  if ((model.array().square().colwise().mean() < 0.01 * log.tau.array().square().colwise().mean()).all())
    return 1e9;  // another unit of torque
  double most = 0.0;
  for (int j = 0; j < (joints > 0 ? joints : log.joints()); ++j)
    most = std::max(most, bare(log, j, log.tau.col(j) - model.col(j)).squaredNorm() /
                              bare(log, j, log.tau.col(j), false).squaredNorm());
  return most;
}

std::string vector_text(const Eigen::VectorXd& x) {
  std::string text;
  for (Eigen::Index i = 0; i < x.size(); ++i) text += (i ? "," : "") + std::to_string(x[i]);
  return text;
}

/// A random reading of that name, as a text.
std::string draw_reading(const std::string& name, const Robot& robot, Random& random) {
  const int n = robot.size();
  const auto any_joint = [&] { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  Eigen::VectorXd x = Eigen::VectorXd::Ones(n);
  if (name == "torque_sign") return "torque_sign=-1";
  if (name == "joint_sign") {
    const int count = 1 + static_cast<int>(random() % static_cast<unsigned>(std::max(1, n - 1)));
    for (int i = 0; i < count; ++i) x[any_joint()] = -1.0;
    return "joint_sign=" + vector_text(x);
  }
  std::vector<int> order(static_cast<std::size_t>(n));
  for (int j = 0; j < n; ++j) order[static_cast<std::size_t>(j)] = j + 1;
  const auto order_text = [&] {
    std::string text = "joint_order=";
    for (int j = 0; j < n; ++j) text += (j ? "," : "") + std::to_string(order[static_cast<std::size_t>(j)]);
    return text;
  };
  if (name == "joint_order" || name == "sign_and_order") {
    std::shuffle(order.begin(), order.end(), random);
    return order_text() + (name == "sign_and_order" ? ",torque_sign=-1" : "");
  }
  if (name == "joint_zero" || name == "free_zero" || name == "degrees_and_zero") {
    x.setZero();
    if (name == "free_zero") {
      x[any_joint()] = (random() % 2 ? 1.0 : -1.0) * uniform(random, 0.7, 2.5);
    } else {
      for (int i = 0; i < 2; ++i) x[any_joint()] = (1.0 + double(random() % 3)) * 0.5 * pi;
    }
    for (int j = 0; j < n; ++j)
      if (robot.joints[j].type == JointType::prismatic) x[j] = 0.0;
    return (name == "degrees_and_zero" ? "position_unit=deg,velocity_unit=deg/s,joint_zero="
                                       : "joint_zero=") +
           vector_text(x);
  }
  if (name == "position_unit") return "position_unit=deg,velocity_unit=deg/s";
  if (name == "velocity_unit") return "velocity_unit=deg/s";
  if (name == "torque_unit") return "torque_unit=Nmm";
  if (name == "torque_is_motor_side") {
    for (double& f : x) f = uniform(random, 50.0, 160.0);
    return "torque_is_motor_side=" + vector_text(x);
  }
  if (name == "torque_is_current") {
    for (double& f : x) f = uniform(random, 5.0, 15.0);
    return "torque_is_current=" + vector_text(x);
  }
  if (name == "torque_without_gravity") return "torque_without_gravity=1";
  if (name == "no_gravity_motor_side") {
    for (double& f : x) f = uniform(random, 50.0, 160.0);
    return "torque_without_gravity=1,torque_is_motor_side=" + vector_text(x);
  }
  if (name == "torque_is_magnitude") return "torque_is_magnitude=1";
  if (name == "gravity") {
    const char* mountings[] = {"gravity=9.81,0,0", "gravity=0,-9.81,0", "gravity=0,0,9.81",
                               "gravity=-9.81,0,0", "gravity=6.937,0,-6.937"};
    return mountings[random() % 5];
  }
  return "time_unit=ms";
}

const std::vector<std::string> readings = {"torque_sign",
                                           "joint_sign",
                                           "joint_order",
                                           "joint_zero",
                                           "free_zero",
                                           "position_unit",
                                           "velocity_unit",
                                           "torque_unit",
                                           "torque_is_motor_side",
                                           "torque_is_current",
                                           "torque_without_gravity",
                                           "torque_is_magnitude",
                                           "gravity",
                                           "time_unit",
                                           "sign_and_order",
                                           "degrees_and_zero",
                                           "no_gravity_motor_side"};

Robot with_condition(Robot robot, int condition, unsigned long seed) {
  double mass = 0.0, reach = robot.tip.translation().norm() + 0.05;
  for (const Joint& joint : robot.joints) mass += joint.parameters[0];
  if (condition == 1) {
    const double m = 0.06 * mass, side = 0.3 * reach;
    return with_payload(robot, {m,
                                {0.2 * reach, 0.1 * reach, 0.4 * reach},
                                Eigen::Matrix3d(m * side * side * Eigen::Matrix3d::Identity())});
  }
  if (condition == 2) {
    Random random(seed);
    for (Joint& joint : robot.joints) {
      joint.friction.linear.viscous *= uniform(random, 0.0, 3.0);
      joint.friction.linear.coulomb *= uniform(random, 0.0, 3.0);
      joint.friction.sigmoid.phi1 *= uniform(random, 0.0, 3.0);
    }
  }
  return robot;
}

int cases_from_environment(int usual) {
  const char* text = std::getenv("DYNID_CONVENTION_CASES");
  return text != nullptr ? std::max(1, std::atoi(text)) : usual;
}

/// A fresh bank: DYNID_CONVENTION_SEED is where its seeds begin.
unsigned long seed_from_environment(unsigned long usual) {
  const char* text = std::getenv("DYNID_CONVENTION_SEED");
  return text != nullptr ? std::strtoul(text, nullptr, 10) : usual;
}

/// Largest relative difference of two matrices' columns, constants apart.
double apart(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  double most = 0.0;
  for (Eigen::Index j = 0; j < a.cols(); ++j) {
    const Eigen::VectorXd x = a.col(j).array() - a.col(j).mean(), y = b.col(j).array() - b.col(j).mean();
    most = std::max(most, (x - y).norm() / std::max(y.norm(), 1e-12));
  }
  return most;
}

/// The names in a text for parse_assumptions().
std::set<std::string> keys_of(const std::string& text) {
  std::set<std::string> keys;
  std::size_t at = 0;
  for (auto equals = text.find('='); equals != std::string::npos; equals = text.find('=', equals + 1)) {
    at = text.rfind(',', equals);
    at = at == std::string::npos ? 0 : at + 1;
    keys.insert(text.substr(at, equals - at));
  }
  return keys;
}

/// Gravity is but an offset on every joint: none at all cannot be told from it.
bool gravity_is_an_offset(const Robot& robot, const Log& log) {
  Robot floating = robot;
  floating.gravity.setZero();
  return apart(predict_torque(floating, log.q, log.dq, log.ddq).tau,
               predict_torque(robot, log.q, log.dq, log.ddq).tau) < 0.01;
}

/// Why no one can tell this reading on that robot from something else; empty where one can.
std::string undecidable(const std::string& name, int joints) {
  if (joints > 1) return "";
  if (name == "joint_order" || name == "sign_and_order") return "there is one order";
  if (name == "gravity") return "a zero, by another name";
  // tau = (J ddq + friction) / k with k free: a rotor of any size.
  if (name == "no_gravity_motor_side") return "a rotor, by another name";
  // m g l cos(q + phi): each is another phi, which is where the centre of mass lies.
  if (name == "joint_zero" || name == "free_zero" || name == "joint_sign") return "another centre of mass";
  return "";
}

/// Joints from 0 whose torque, friction apart, goes with that of the robot that the log is of: the others
/// hardly feel the arm, and what factor their torque has is not to be seen.
std::vector<int> feeling(const Robot& robot, const Log& right) {
  Robot without = robot;
  for (Joint& joint : without.joints) joint.friction = {};
  const Eigen::MatrixXd body = predict_torque(without, right.q, right.dq, right.ddq).tau;
  std::vector<int> out;
  for (int j = 0; j < right.joints(); ++j) {
    const Eigen::VectorXd x = bare(right, j, body.col(j), false), y = bare(right, j, right.tau.col(j), false);
    if (x.dot(y) * x.dot(y) > ConventionOptions().least_felt * x.squaredNorm() * y.squaredNorm())
      out.push_back(j);
  }
  return out;
}

/// Read back, the log is the right one to the last digits: so is every diagnosis of it.
bool is_exact(const std::string& name) {
  static const std::set<std::string> exact = {"torque_sign", "joint_order", "position_unit",  "velocity_unit",
                                              "torque_unit", "time_unit",   "sign_and_order", "gravity"};
  return exact.count(name) > 0;
}

/// What a robot without friction would have made the log say, did its author mean it as `a` says.
Eigen::MatrixXd said_by(const Robot& robot, const Assumptions& a, const Log& log) {
  Robot bare_robot = apply_conventions(a, robot);
  for (Joint& joint : bare_robot.joints) joint.friction = {};
  Log meant = apply_conventions(a, bare_robot, log);
  meant.tau = predict_torque(bare_robot, meant.q, meant.dq, meant.ddq).tau;
  return misread(a, bare_robot, meant).tau;
}

/// No one can tell the two readings apart on this log: the nominal robot would have made it say the same, to
/// within what nominal models are off by (ConventionOptions::model_error of each torque's energy).
bool equivalent(const Robot& robot, const Assumptions& a, const Assumptions& b, const Log& log) {
  const Eigen::MatrixXd first = said_by(robot, a, log), second = said_by(robot, b, log);
  for (int k = 0; k < log.joints(); ++k) {
    const double all = bare(log, k, log.tau.col(k)).squaredNorm();
    if (bare(log, k, first.col(k) - second.col(k)).squaredNorm() > ConventionOptions().model_error * all)
      return false;
  }
  return true;
}

enum class Answer { right, equal, undecided, nothing, wrong };

/// What the report says of a log that was written as `truth` says. right: without its mistakes.
Answer answer_of(const ConventionReport& report, const std::string& name, const std::string& text,
                 const Robot& robot, const Log& log, const Log& right, int condition) {
  if (report.conventions.empty()) {
    // It says that it cannot tell, and what is true stands among the readings that it names.
    for (const std::string& other : report.undecided) {
      ConventionReport said;
      said.assume = other;
      said.conventions.resize(1);
      const Answer answer = answer_of(said, name, text, robot, log, right, condition);
      if (answer == Answer::right || answer == Answer::equal) return Answer::undecided;
    }
    return Answer::nothing;
  }
  const Assumptions truth = parse_assumptions(text, robot.size());
  const Assumptions found = parse_assumptions(report.assume, robot.size());
  const Log back = apply_conventions(found, robot, log);
  const Robot mounted = apply_conventions(truth, robot);
  // Where a factor for each joint is sought, on those that show theirs.
  Eigen::MatrixXd read = back.tau, meant = right.tau;
  if (truth.torque_factor.size() > 0 && found.torque_factor.size() > 0) {
    const std::vector<int> felt = feeling(apply_conventions(truth, robot), right);
    read = Eigen::MatrixXd(back.tau(Eigen::all, felt)), meant = Eigen::MatrixXd(right.tau(Eigen::all, felt));
  }
  bool good = (truth.magnitude || apart(read, meant) < 0.35) && found.magnitude == truth.magnitude &&
              apart(back.t, right.t) < 1e-9 && found.gravity.has_value() == truth.gravity.has_value() &&
              (!found.gravity || (*found.gravity - *truth.gravity).norm() < 1.8);
  // A turn of 360 deg is none, and a zero that no torque shows is not found.
  good = good && visibility(mounted, back) < std::max(1.0, 1.2 * visibility(mounted, right));
  // A payload and factors that nobody knows share the torque: their names must be right.
  if (condition == 1 && truth.torque_factor.size() > 0) {
    std::set<std::string> keys = keys_of(text);
    if (gravity_is_an_offset(robot, right)) keys.erase("torque_without_gravity");
    good = keys_of(report.assume) == keys;
  }
  if (is_exact(name) && good) good = apart(back.tau, right.tau) < 1e-9 && apart(back.q, right.q) < 1e-9;
  if (good) return Answer::right;
  return equivalent(robot, truth, found, log) ? Answer::equal : Answer::wrong;
}

TEST(Conventions, EveryReadingIsNamedAndReadBack) {
  const int repeats = cases_from_environment(1);
  // By reading and robot: named right; as one that is equivalent on the log; among those that the log cannot
  // tell from something else; visible; all.
  std::map<std::string, std::map<std::string, std::array<int, 5>>> table;
  std::array<int, 5> sum{};
  std::map<int, std::array<int, 2>> by_condition;  // right or equal, visible
  std::string wrong;
  unsigned long seed = seed_from_environment(100);
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (const Robot& robot : robots()) {
      for (int condition = 0; condition < 3; ++condition) {
        for (const std::string& name : readings) {
          Random random(++seed);
          if (!undecidable(name, robot.size()).empty()) continue;
          const std::string text = draw_reading(name, robot, random);
          const Assumptions truth = parse_assumptions(text, robot.size());
          const Robot plant =
              apply_conventions(truth, with_condition(perturbed(robot, 0.03, seed), condition, seed));
          const Log right = recorded(plant, 20.0, 100.0, seed);
          const Log log = misread(truth, robot, right);
          std::array<int, 5>& cell = table[name][robot.name];
          const auto count = [&](std::size_t k) { ++cell[k], ++sum[k]; };
          count(4);
          const bool of_motion = name == "velocity_unit" || name == "time_unit";
          // The zero of the last joint alone is not told from a payload.
          const bool zero_alone = name == "joint_zero" || name == "free_zero";
          if (!of_motion && seen(robot, log, zero_alone ? robot.size() - 1 : 0) < 1.0) continue;
          count(3);
          const ConventionReport report = find_conventions(robot, {log});
          const Answer answer = answer_of(report, name, text, robot, log, right, condition);
          if (answer == Answer::right) count(0);
          if (answer == Answer::equal) count(1);
          if (answer == Answer::undecided) count(2);
          ++by_condition[condition][1];
          if (answer == Answer::right || answer == Answer::equal) {
            ++by_condition[condition][0];
            if (answer == Answer::right) continue;
          }
          wrong += "\n  " +
                   std::string(answer == Answer::equal       ? "equal: "
                               : answer == Answer::undecided ? "cannot tell: "
                                                             : "") +
                   robot.name + ", condition " + std::to_string(condition) + ", seed " +
                   std::to_string(seed) + ": " + text + " read as '" + report.assume + "' explained " +
                   std::to_string(report.explained) + ", runner-up " + report.runner_up;
        }
      }
    }
  }
  std::printf("named right + as an equivalent one + as one that cannot be told / visible (of all)\n%-24s",
              "");
  for (const Robot& robot : robots()) std::printf(" %-16s", robot.name.c_str());
  for (const std::string& name : readings) {
    std::printf("\n%-24s", name.c_str());
    for (const Robot& robot : robots()) {
      const std::array<int, 5>& c = table[name][robot.name];
      char text[40];
      std::snprintf(text, sizeof text, "%d+%d+%d/%d (%d)", c[0], c[1], c[2], c[3], c[4]);
      std::printf(" %-16s", c[4] > 0 ? text : "-");
    }
  }
  std::printf(
      "\nnamed right %d, as an equivalent one %d, as one that cannot be told %d, of %d visible of %d\n",
      sum[0], sum[1], sum[2], sum[3], sum[4]);
  const char* conditions[] = {"healthy", "payload", "friction"};
  for (const auto& [condition, counts] : by_condition)
    std::printf("%s: %d of %d\n", conditions[condition], counts[0], counts[1]);
  EXPECT_GE(sum[0] + sum[1], 0.97 * (sum[3] - sum[2])) << wrong;
  EXPECT_LE(sum[2], 0.03 * sum[3]) << wrong;
  if (!wrong.empty()) std::printf("not:%s\n", wrong.c_str());
}

// A log that is read well is left alone, whatever else is wrong with the robot.
TEST(Conventions, ImperfectRobotsAreNotMisread) {
  const int repeats = cases_from_environment(4);
  int all = 0, alarms = 0;
  std::string wrong;
  unsigned long seed = seed_from_environment(5000);
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (const Robot& robot : robots()) {
      for (int kind = 0; kind < 15; ++kind) {
        Random random(++seed);
        const int n = robot.size();
        Robot plant = perturbed(robot, uniform(random, 0.02, 0.05), seed);
        const int j = static_cast<int>(random() % static_cast<unsigned>(n));
        double mass = 0.0;
        for (const Joint& joint : robot.joints) mass += joint.parameters[0];
        if (kind == 1) plant = with_condition(plant, 1, seed);
        if (kind == 2) {
          const double m = uniform(random, 0.02, 0.2) * mass;
          plant = with_payload(plant, {m, test::random_vector(random, 0.2),
                                       Eigen::Matrix3d(m * 0.003 * Eigen::Matrix3d::Identity())});
        }
        if (kind == 3) plant.joints[j].parameters *= (random() % 2) ? 1.4 : 0.6;
        if (kind == 4)
          plant.gravity = Eigen::AngleAxisd(6.0 * pi / 180.0, test::random_direction(random)) * plant.gravity;
        if (kind == 5)
          for (Joint& joint : plant.joints) joint.friction = {};
        if (kind == 6)
          for (Joint& joint : plant.joints)
            joint.rotor_inertia = uniform(random, 0.0, 0.3) * std::max(0.05, joint.parameters[6]);
        if (kind == 7) plant = with_condition(plant, 2, seed);
        if (kind == 14 &&
            n > 1) {  // a wrist's body turned about its joint, and heavier: no zero of the joint
          Joint& wrist = plant.joints[n - 2];
          const Eigen::Matrix3d R = Eigen::AngleAxisd(pi / 2.0, wrist.axis).toRotationMatrix();
          LinkInertia body = from_standard(wrist.parameters);
          body.com = R * body.com;
          body.inertia = R * body.inertia * R.transpose();
          wrist.parameters = 4.0 * to_standard(body);
        }
        Log log = recorded(plant, 20.0, 100.0, seed);
        const Eigen::VectorXd size =
            (log.tau.rowwise() - log.tau.colwise().mean()).colwise().norm().transpose() /
            std::sqrt(log.samples());
        if (kind == 8) log.tau.col(j) *= uniform(random, 0.75, 1.25);
        if (kind == 9) log.q.col(j).array() += uniform(random, -0.08, 0.08);
        if (kind == 10) log.tau.col(j) += size[j] * log.q.col(j);
        if (kind == 11) {
          const int late = 3;
          const Eigen::MatrixXd tau = log.tau;
          log.tau.bottomRows(log.samples() - late) = tau.topRows(log.samples() - late);
        }
        if (kind == 12)
          for (int k = 0; k < n; ++k)
            log.tau.col(k) = log.tau.col(k).cwiseMax(-0.8 * size[k]).cwiseMin(0.8 * size[k]).eval();
        if (kind == 13) log.tau.middleRows(300, 300).rowwise() += 3.0 * size.transpose();
        ++all;
        const ConventionReport report = find_conventions(robot, {log});
        if (report.conventions.empty()) continue;
        ++alarms;
        wrong += "\n  " + robot.name + ", kind " + std::to_string(kind) + ", seed " + std::to_string(seed) +
                 ": '" + report.assume + "' " + std::to_string(report.conventions[0].explained_before) +
                 " -> " + std::to_string(report.conventions[0].explained_after);
      }
    }
  }
  std::printf("false alarms: %d of %d\n", alarms, all);
  EXPECT_EQ(alarms, 0) << wrong;
}

TEST(Conventions, EffectsOfTheCatalogueAreNotMisread) {
  const int repeats = cases_from_environment(1);
  unsigned long seed = seed_from_environment(40);
  int all = 0, alarms = 0;
  std::string wrong;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (const Robot& robot : robots()) {
      for (const EffectSchema& spec : effect_schemas()) {
        Random random(++seed);
        RandomMotionOptions motion;
        motion.base_frequency = 0.125;
        SimulateOptions options;
        options.seed = seed;
        options.spread = uniform(random, 0.02, 0.05);
        options.rate = 250.0;
        options.integration_rate = 1000.0;
        options.record_torques = false;
        try {
          const Effect effect = draw_effect(spec.name, robot, seed, 1.0, 8.0);
          const SimulatedRun run =
              simulate(robot, {effect}, random_motion(robot, 8.0, seed, motion), options);
          ++all;
          const ConventionReport report = find_conventions(robot, {run.log});
          alarms += !report.conventions.empty();
          if (!report.conventions.empty())
            wrong += "\n  " + robot.name + ", " + spec.name + ", seed " + std::to_string(seed) + ": '" +
                     report.assume + "' " + std::to_string(report.conventions[0].explained_before) + " -> " +
                     std::to_string(report.conventions[0].explained_after);
        } catch (const Error&) {
          continue;  // the robot ran away, or cannot have it: no log
        }
      }
    }
  }
  std::printf("false alarms: %d of %d%s\n", alarms, all, wrong.c_str());
  EXPECT_GT(all, 75 * repeats);
  EXPECT_EQ(alarms, 0) << wrong;
}

TEST(Conventions, HalfASecondForAMinuteAtOneKilohertz) {
  if (test::sanitized)
    GTEST_SKIP() << "processor time is measured, and a sanitizer takes several times as much";
  const Robot robot = robots()[0];
  const Log log = recorded(robot, 60.0, 1000.0, 7);
  for (const char* text : {"", "joint_zero=0,1.570796327,0,0.9,0,0,0"}) {
    const Log wrong = misread(parse_assumptions(text, 7), robot, log);
    double least = 1e9;
    for (int run = 0; run < 3; ++run) {
      const std::clock_t start = std::clock();
      find_conventions(robot, {wrong});
      least = std::min(least, double(std::clock() - start) / CLOCKS_PER_SEC);
    }
    std::printf("60 s at 1 kHz, '%s': %.3f s\n", text, least);
    EXPECT_LT(least, 0.5) << text;
  }
}

TEST(Conventions, WithoutAModelOrMotionNothingIsFound) {
  Robot robot = one_joint();
  const Log log = recorded(robot, 10.0, 100.0, 3);
  Robot bare = robot;
  bare.joints[0].parameters.setZero();
  EXPECT_EQ(find_conventions(bare, {log}).assume, "");
  Log still = log;
  still.q.setConstant(0.3);
  still.dq.setZero();
  EXPECT_EQ(find_conventions(robot, {still}).assume, "");
  EXPECT_EQ(find_conventions(robot, {}).assume, "");
  Log two = log;
  two.q = Eigen::MatrixXd::Zero(log.samples(), 2);
  EXPECT_THROW(find_conventions(robot, {two}), Error);
}

// ------------------------------------------------------------------------------------------- real robots

class RealLogs : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("DYNID_DATA");
    if (folder == nullptr) GTEST_SKIP() << "DYNID_DATA is not set";
    data_ = std::string(folder) + "/";
  }
  ConventionReport of(const std::string& robot, const std::vector<std::string>& names) {
    const Robot nominal = read_robot(robot, "", "", Consistency::ignore);
    std::vector<Log> logs;
    for (const std::string& name : names) logs.push_back(read_log(data_ + name, nominal.size()));
    const ConventionReport report = find_conventions(nominal, logs);
    std::printf("%s: explained %.3f, assume '%s'", names[0].c_str(), report.explained, report.assume.c_str());
    for (const Convention& c : report.conventions)
      std::printf(" %.3f -> %.3f", c.explained_before, c.explained_after);
    std::printf(" runner-up '%s' %.3f\n", report.runner_up.c_str(), report.runner_up_explained);
    return report;
  }
  std::string panda() const { return std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml"; }
  std::string data_;
};

TEST_F(RealLogs, ThoseReadWellAreLeftAlone) {
  EXPECT_EQ(of(panda(), {"panda_real/exciting.csv"}).assume, "");
  EXPECT_EQ(of(panda(), {"panda_real/second_panda_30hz.csv"}).assume, "");
  for (const char* name : {"unloaded", "loaded", "unloaded_other_trajectory"})
    EXPECT_EQ(of(data_ + "ur10e_real/ur10e.urdf", {"ur10e_real/" + std::string(name) + ".csv"}).assume, "");
  for (const char* name : {"kuka_hw_1", "kuka_hw_2"})
    EXPECT_EQ(
        of(data_ + "kuka_lwr4_real/kuka_lwr4.urdf", {"kuka_lwr4_real/" + std::string(name) + ".csv"}).assume,
        "");
  for (const char* name : {"none", "ins105", "ins205"})
    EXPECT_EQ(of(data_ + "psm_real/psm.urdf", {"psm_real/psm_" + std::string(name) + ".csv"}).assume, "");
  for (int k = 0; k < 12; ++k) {
    const std::string folder =
        "gap_examples/example_" + std::string(k < 10 ? "0" : "") + std::to_string(k) + "/";
    EXPECT_EQ(of(panda(), {folder + "log_a.csv", folder + "log_b.csv"}).assume, "") << folder;
  }
}

TEST_F(RealLogs, AnArmOnAWallIsSeenToBe) {
  const ConventionReport report = of(data_ + "rokae_real/AR5-5_07R-W4C4A2.urdf", {"rokae_real/ar5.csv"});
  ASSERT_FALSE(report.conventions.empty());
  const Assumptions found = parse_assumptions(report.assume, 7);
  ASSERT_TRUE(found.gravity.has_value()) << report.assume;
  EXPECT_LT((*found.gravity - Eigen::Vector3d(9.81, 0, 0)).norm(), 1.0) << report.assume;
}

TEST_F(RealLogs, ATurnedTorqueAndTurnedZerosAreSeen) {
  const Robot robot = read_robot(panda(), "", "", Consistency::ignore);
  const Log log = read_log(data_ + "panda_real/exciting.csv", 7);
  for (const char* text :
       {"torque_sign=-1", "joint_zero=0,1.570796327,0,-1.570796327,0,0,0", "torque_unit=Nmm"}) {
    const Log wrong = misread(parse_assumptions(text, 7), robot, log);
    const ConventionReport report = find_conventions(robot, {wrong});
    EXPECT_EQ(report.assume, text);
  }
}

TEST_F(RealLogs, OtherArmsTurnedAreSeenToo) {
  const std::string urdf = data_ + "ur10e_real/ur10e.urdf";
  const Robot robot = read_robot(urdf, "", "", Consistency::ignore);
  const Log log = read_log(data_ + "ur10e_real/unloaded.csv", 6);
  for (const char* text : {"torque_sign=-1", "joint_zero=0,1.570796327,-1.570796327,0,0,0"}) {
    const Log wrong = misread(parse_assumptions(text, 6), robot, log);
    EXPECT_EQ(find_conventions(robot, {wrong}).assume, text);
  }
  // Friction of the model is not used: a placeholder's damping does not hide a reading.
  Robot damped = robot;
  for (Joint& joint : damped.joints) joint.friction.linear.viscous = 50.0;
  const Log turned = misread(parse_assumptions("torque_sign=-1", 6), damped, log);
  EXPECT_EQ(find_conventions(damped, {turned}).assume, "torque_sign=-1");
}

// A vendor's model explains these poorly even when they are read well: no part may be added that only helps.
TEST_F(RealLogs, PoorModelsAreTurnedAndNoMore) {
  struct Case {
    std::string robot, log;
    std::vector<std::string> texts;
  };
  const std::string kuka = data_ + "kuka_lwr4_real/kuka_lwr4.urdf";
  const std::vector<std::string> seven = {"torque_sign=-1", "joint_zero=0,1.570796327,0,-1.570796327,0,0,0",
                                          "joint_zero=0,1.570796327,0,1.570796327,0,0,0",
                                          "joint_zero=0,0,1.570796327,1.570796327,0,0,0"};
  for (const Case& c :
       {Case{kuka, "kuka_lwr4_real/kuka_hw_1.csv", seven}, Case{kuka, "kuka_lwr4_real/kuka_hw_2.csv", seven},
        Case{panda(), "panda_real/exciting.csv", seven},
        Case{panda(), "panda_real/second_panda_30hz.csv", seven},
        Case{data_ + "ur10e_real/ur10e.urdf",
             "ur10e_real/unloaded_other_trajectory.csv",
             {"torque_sign=-1", "joint_zero=0,1.570796327,0,1.570796327,0,0",
              "joint_zero=0,-1.570796327,0,-1.570796327,0,0"}},
        Case{data_ + "ur10e_real/ur10e.urdf",
             "ur10e_real/loaded.csv",
             {"torque_sign=-1", "joint_zero=0,1.570796327,0,1.570796327,0,0"}}}) {
    const Robot robot = read_robot(c.robot, "", "", Consistency::ignore);
    const Log log = read_log(data_ + c.log, robot.size());
    for (const std::string& text : c.texts) {
      const Log wrong = misread(parse_assumptions(text, robot.size()), robot, log);
      const ConventionReport report = find_conventions(robot, {wrong});
      EXPECT_EQ(report.assume, text) << c.log << " explained " << report.explained << ", runner-up "
                                     << report.runner_up << "; " << report.undecided_text;
    }
  }
}

TEST(Conventions, AClippedJointSaysNothing) {
  const Robot robot = robots()[1];
  Log log = misread(parse_assumptions("torque_sign=-1", 6), robot, recorded(robot, 20.0, 100.0, 11));
  EXPECT_EQ(find_conventions(robot, {log}).assume, "torque_sign=-1");
  for (int j = 0; j < 6; ++j) {
    const double most = 0.5 * log.tau.col(j).cwiseAbs().maxCoeff();
    log.tau.col(j) = log.tau.col(j).cwiseMin(most).cwiseMax(-most).eval();
  }
  EXPECT_EQ(find_conventions(robot, {log}).assume, "");
}

TEST(Conventions, TheLastZeroAloneIsNotToldFromAPayload) {
  const Robot robot = robots()[1];
  const Log right = recorded(robot, 20.0, 100.0, 12);
  const auto found = [&](const char* text) {
    return find_conventions(robot, {misread(parse_assumptions(text, 6), robot, right)}).assume;
  };
  EXPECT_EQ(found("joint_zero=0,0,0,0,0,1.570796327"), "");
  EXPECT_EQ(found("joint_zero=0,0,1.570796327,0,0,0"), "joint_zero=0,0,1.570796327,0,0,0");
}

// ------------------------------------------------------------------------------------------- assumptions

TEST(Assumptions, AnEmptyTextChangesNothing) {
  EXPECT_TRUE(parse_assumptions("", 3).empty());
  const Robot robot = one_joint();
  const Log log = recorded(robot, 2.0, 100.0, 1);
  const Log same = apply_conventions(parse_assumptions("", 1), robot, log);
  EXPECT_EQ(same.q, log.q);
  EXPECT_EQ(same.tau, log.tau);
  EXPECT_EQ(same.t, log.t);
}

TEST(Assumptions, EveryReadingIsUndone) {
  const Robot robot = robots()[0];
  const Log log = recorded(robot, 2.0, 100.0, 1);
  Random random(3);
  for (const std::string& name : readings) {
    const std::string text = draw_reading(name, robot, random);
    const Assumptions a = parse_assumptions(text, 7);
    EXPECT_FALSE(a.empty()) << text;
    const Robot plant = apply_conventions(a, robot);
    const Log back = apply_conventions(a, robot, misread(a, robot, log));
    EXPECT_LT(apart(back.q, log.q), 1e-12) << text;
    EXPECT_LT(apart(back.dq, log.dq), 1e-12) << text;
    EXPECT_LT(apart(back.t, log.t), 1e-12) << text;
    EXPECT_LT(apart(back.tau, log.tau), name == "torque_is_magnitude" ? 0.2 : 1e-9) << text;
    if (a.gravity) {
      EXPECT_EQ(plant.gravity, *a.gravity);
    }
  }
}

TEST(Assumptions, MistakesAreNamedByKey) {
  const auto error = [](const std::string& text) {
    return test::error_of([&] { parse_assumptions(text, 3); });
  };
  for (const auto& [text, part] : std::vector<std::pair<std::string, std::string>>{
           {"torque_sign", "KEY=VALUE"},
           {"colour=red", "colour: unknown"},
           {"torque_sign=2", "torque_sign: a sign is 1 or -1"},
           {"torque_sign=1,-1", "torque_sign: 2 values given, 3 needed"},
           {"joint_order=1,2,2", "joint_order: each of 1 to 3"},
           {"joint_zero=0,x,0", "joint_zero: 'x' is not a number"},
           {"position_unit=furlong", "position_unit: unknown unit 'furlong'"},
           {"gravity=0,0", "gravity: 2 values given, 3 needed"},
           {"torque_unit=Nmm,torque_is_current=3", "torque_is_current: another factor"},
           {"torque_without_gravity=perhaps", "torque_without_gravity: 1 or 0"},
           {"time_unit=-1", "time_unit: time does not run backwards"},
           {"gravity=0,0,1,gravity=0,0,2", "gravity: given twice"}}) {
    EXPECT_NE(error(text).find(part), std::string::npos) << text << " -> " << error(text);
    EXPECT_EQ(error(text).find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace dynid
