// SPDX-License-Identifier: Apache-2.0
// Law: a longer log of the same robot has the same diagnosis, with hardly more memory.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>
#include <string>

#include "dynid/diagnosis/diagnose.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid {
namespace {

/// A shoulder and an elbow, upright, with friction.
Robot two_joints() {
  Robot robot;
  robot.name = "two joints";
  for (const double mass : {4.0, 2.0}) {
    Joint joint;
    joint.name = robot.joints.empty() ? "shoulder" : "elbow";
    joint.link_name = joint.name + "_link";
    joint.type = JointType::revolute;
    joint.origin.linear() =
        Eigen::AngleAxisd(robot.joints.empty() ? M_PI / 2.0 : 0.0, Eigen::Vector3d::UnitX())
            .toRotationMatrix();
    joint.origin.translation() = Eigen::Vector3d(robot.joints.empty() ? 0.0 : 0.4, 0.0, 0.0);
    LinkInertia link;
    link.mass = mass;
    link.com = Eigen::Vector3d(0.2, 0.01, 0.0);
    link.inertia = 0.02 * mass * Eigen::Matrix3d::Identity();
    joint.parameters = to_standard(link);
    joint.limits.lower = -2.0, joint.limits.upper = 2.0;
    joint.limits.velocity = 3.0, joint.limits.torque = 80.0;
    joint.friction.linear.coulomb = 0.5;
    joint.friction.linear.viscous = 0.8;
    robot.joints.push_back(joint);
  }
  return robot;
}

/// Of about `seconds`: one motion, and its beginnings.
Log recorded(const Robot& robot, double seconds, unsigned long seed) {
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic();
  options.measurement.correlated_noise = 0.0;
  options.rate = 200.0;
  options.seed = seed;
  options.record_torques = false;
  return simulate(robot, {parse_effect("coulomb_friction:joints=2,coefficient=0.7", robot)},
                  random_motion(robot, seconds, seed), options)
      .log;
}

std::set<std::string> names(const Diagnosis& d) {
  std::set<std::string> out;
  for (const FoundEffect& e : d.effects) {
    std::string text = e.effect.name;
    for (const int joint : e.effect.joints) text += " " + std::to_string(joint);
    out.insert(text);
  }
  return out;
}

/// [kB] of the process: "VmRSS", or "VmHWM" since restart_peak(); 0 where the system does not say.
long memory(const std::string& which) {
  std::ifstream file("/proc/self/status");
  for (std::string word; file >> word;)
    if (word == which + ":") {
      long size = 0;
      file >> size;
      return size;
    }
  return 0;
}
bool restart_peak() {
  std::ofstream file("/proc/self/clear_refs");
  file << "5" << std::flush;
  return bool(file);
}

struct Measured {
  Diagnosis diagnosis;
  long grown = -1;  // [kB]; negative: not known
};
Measured diagnosed(const Robot& robot, double seconds) {
  const std::vector<Log> logs = {recorded(robot, seconds, 5), recorded(robot, seconds, 6)};
  DiagnoseOptions options;
  // So that a test need not be of minutes.
  options.criteria.searched_rows = 800;
  options.criteria.window_rows = 100;
  options.replay = false;
  const bool known = restart_peak();
  const long before = memory("VmRSS");
  Measured out{diagnose(robot, logs, options)};
  if (known && before > 0) out.grown = memory("VmHWM") - before;
  return out;
}

TEST(LongLogs, SameNamesBoundedMemory) {
  const Robot robot = two_joints();
  diagnosed(robot, 8.0);  // what is allocated once
  const Measured brief = diagnosed(robot, 16.0), longer = diagnosed(robot, 128.0);
  ASSERT_EQ(brief.diagnosis.verdict, Verdict::explained) << to_string(brief.diagnosis.verdict);
  EXPECT_EQ(longer.diagnosis.verdict, Verdict::explained) << to_string(longer.diagnosis.verdict);
  EXPECT_EQ(names(brief.diagnosis), std::set<std::string>{"coulomb_friction 2"});
  EXPECT_EQ(names(longer.diagnosis), names(brief.diagnosis));
  // All rows are fitted and shown, not those alone that were searched.
  EXPECT_GT(longer.diagnosis.series.t.size(), 7 * brief.diagnosis.series.t.size());
  const auto width = [](const Measured& run) {
    for (const ParameterEstimate& e : run.diagnosis.effects.at(0).parameters)
      if (e.key == "coefficient") return e.high[1] - e.low[1];
    return 0.0;
  };
  EXPECT_LE(width(longer), width(brief));
  if (longer.grown < 0) GTEST_SKIP() << "the system does not say how much memory is used";
  // Eight times the log. Kept whole, the columns of all grid points would make it eight times the memory.
  EXPECT_LE(longer.grown, 3 * brief.grown) << brief.grown << " kB, " << longer.grown << " kB";
}

}  // namespace
}  // namespace dynid
