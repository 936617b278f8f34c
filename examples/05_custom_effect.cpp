// SPDX-License-Identifier: Apache-2.0
//
// An effect that the library does not know, sought beside the 22 that it does: oil that a joint churns,
// c |dq| dq. Usage: 05_custom_effect MODEL.
#include <cmath>
#include <cstdio>
#include <dynid/diagnosis/diagnose.hpp>
#include <dynid/diagnosis/hypothesis.hpp>
#include <dynid/model/robot_file.hpp>
#include <dynid/simulation/random_motion.hpp>
#include <dynid/simulation/simulate.hpp>

class ChurnedOil : public dynid::Hypothesis {
 public:
  std::string name() const override { return "churned_oil"; }
  /// One column in the joint's own torque [N m per unit of c]; `speed` is the velocity in the band that
  /// friction needs.
  dynid::ColumnBlock columns(const dynid::GapMotion& motion, int joint,
                             const Eigen::VectorXd&) const override {
    const Eigen::ArrayXd speed = motion.speed.col(joint).array();
    return {{joint}, {(speed * speed.abs()).matrix()}};
  }
  /// Of this joint: one number.
  std::vector<dynid::NamedValue> parameters(const dynid::Robot&, int, const Eigen::VectorXd& c,
                                            const Eigen::VectorXd&) const override {
    return {{"coefficient", "N m s^2/rad^2", c.head(1)}};
  }
  void restore(const dynid::Robot&, const dynid::Effect& effect, int joint, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c = Eigen::VectorXd::Constant(1, effect.parameters.at("coefficient").at(joint));
    shape.resize(0);
  }
  bool plausible(const dynid::Robot&, int, const Eigen::VectorXd& c, const Eigen::VectorXd&) const override {
    return c[0] > 0.0;  // oil drives nothing
  }
};

int main(int argc, char** argv) try {
  if (argc != 2) throw dynid::Error("usage: 05_custom_effect MODEL");
  const dynid::Robot robot = dynid::read_robot(argv[1]);

  std::vector<dynid::Log> logs;  // of a robot that has it on joint 2
  for (const unsigned long seed : {31UL, 32UL}) {
    dynid::SimulateOptions options;
    options.measurement = dynid::MeasurementOptions::realistic();
    options.rate = 250.0;
    options.seed = seed;
    logs.push_back(dynid::simulate(robot, {}, dynid::random_motion(robot, 8.0, seed), options).log);
    const Eigen::ArrayXd speed = logs.back().dq.col(1).array();
    logs.back().tau.col(1).array() += 1.5 * speed * speed.abs();
  }

  const ChurnedOil oil;
  dynid::DiagnoseOptions options;
  options.extra = {&oil};
  options.replay = false;  // no model file can say it, and no plant moves with it
  const dynid::Diagnosis d = dynid::diagnose(robot, logs, options);
  for (const dynid::FoundEffect& found : d.effects)
    for (const int joint : found.effect.joints)
      std::printf("%s on joint %d: probability %.2f, %.3f %s\n", found.effect.name.c_str(), joint,
                  found.probability, found.parameters[0].value[joint - 1], found.parameters[0].unit.c_str());
  const bool right = d.effects.size() == 1 && d.effects[0].effect.name == oil.name() &&
                     std::abs(d.effects[0].parameters[0].value[1] - 1.5) < 0.1;
  return right ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
