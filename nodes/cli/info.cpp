// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/identification/base_parameters.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption robot;
  std::string model;
  bool rotor_inertia = false;
};

const char* type_name(JointType type) {
  return type == JointType::revolute     ? "revolute"
         : type == JointType::continuous ? "continuous"
                                         : "prismatic";
}

/// JSON has no infinity: a limit that is not known is null.
nlohmann::json number(double x) { return std::isfinite(x) ? nlohmann::json(x) : nlohmann::json(nullptr); }

/// How the data can show standard parameter k: by itself, in a sum with others, or not at all.
const char* identifiability(const BaseParameters& base, int k) {
  bool any = false;
  for (int i = 0; i < base.size(); ++i) {
    if (base.K(i, k) == 0.0) continue;
    any = true;
    if ((base.K.row(i).array() != 0.0).count() == 1) return "alone";
  }
  return any ? "in combination" : "no";
}

void run(Arguments& a) {
  if (a.robot.path.empty()) a.robot.path = a.model;
  a.output.check();
  const ModelFile file = a.robot.read(a.output);
  const Robot& robot = file.robot;
  const BaseParameters base = base_parameters(robot, a.rotor_inertia);
  const std::vector<Inconsistency> broken = inconsistencies(robot);

  nlohmann::json joints = nlohmann::json::array(), coefficients = nlohmann::json::array(),
                 parameters = nlohmann::json::array(), rules = nlohmann::json::array();
  double mass = 0.0;
  for (const Joint& joint : robot.joints) {
    mass += joint.parameters[0];
    joints.push_back({{"name", joint.name},
                      {"link", joint.link_name},
                      {"type", type_name(joint.type)},
                      {"lower", number(joint.limits.lower)},
                      {"upper", number(joint.limits.upper)},
                      {"velocity", number(joint.limits.velocity)},
                      {"acceleration", number(joint.limits.acceleration)},
                      {"jerk", number(joint.limits.jerk)},
                      {"torque", number(joint.limits.torque)},
                      {"torque_rate", number(joint.limits.torque_rate)}});
  }
  for (int i = 0; i < base.size(); ++i)
    coefficients.push_back({{"name", base.names[static_cast<std::size_t>(i)]},
                            {"expression", base.expressions[static_cast<std::size_t>(i)]}});
  for (int k = 0; k < base.parameters(); ++k)
    parameters.push_back(
        {{"name", parameter_name(k, robot.size())}, {"identifiable", identifiability(base, k)}});
  for (const Inconsistency& rule : broken)
    rules.push_back(
        {{"joint", rule.joint}, {"link", rule.link}, {"rule", rule.rule}, {"margin", rule.margin}});
  a.output.write({{"name", robot.name},
                  {"joints", joints},
                  {"gravity", to_json(robot.gravity)},
                  {"total_mass", mass},
                  {"rank", base.size()},
                  {"base_parameters", coefficients},
                  {"standard_parameters", parameters},
                  {"physically_consistent", broken.empty()},
                  {"inconsistencies", rules}});
  if (!a.output.summary()) return;

  std::cout << robot.name << ": " << robot.size() << " joints, " << robot.base_link << " to "
            << robot.tip_link << ", moving mass " << mass << " kg\n";
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const Joint& joint = robot.joints[j];
    std::cout << "  " << j + 1 << "  " << joint.name << "  " << type_name(joint.type) << "  ["
              << joint.limits.lower << ", " << joint.limits.upper << "], velocity " << joint.limits.velocity
              << ", torque " << joint.limits.torque << "\n";
  }
  for (const char* kind : {"alone", "in combination", "no"}) {
    std::cout << "Identifiable " << kind << ":";
    if (std::string(kind) == "no") std::cout << " (no influence on any torque)";
    for (int k = 0; k < base.parameters(); ++k)
      if (std::string(identifiability(base, k)) == kind) std::cout << " " << parameter_name(k, robot.size());
    std::cout << "\n";
  }
  std::cout << base.size() << " base parameters:\n";
  for (int i = 0; i < base.size(); ++i)
    std::cout << "  " << base.names[static_cast<std::size_t>(i)] << " = "
              << base.expressions[static_cast<std::size_t>(i)] << "\n";
  if (broken.empty()) {
    std::cout << "Every link is physically consistent.\n";
  }
}

}  // namespace

void add_info(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("info", "Joints, limits, identifiable parameters and base parameters of a robot");
  a->robot.add_to(*command, "--robot", false);
  a->robot.allow_inconsistent = true;  // to be told of it, not to be sent away
  command->add_option("--model", a->model, "The same as --robot")->type_name("FILE");
  command->add_flag("--rotor-inertia", a->rotor_inertia,
                    "Count reflected rotor inertias among the parameters");
  a->output.add_to(*command);
  command->footer("Example: dynid info --robot config/panda.yaml");
  command->callback([a, &status] {
    if (a->robot.path.empty() == a->model.empty()) throw Error("info: one of --robot and --model is needed");
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
