// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/info.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"

namespace dynid {
namespace {

struct InfoArguments {
  Output output;
  RobotOption robot;
  std::string model;
  bool rotor_inertia = false;
};

void run_info(const InfoArguments& a) {
  if (a.robot.path.empty() == a.model.empty()) throw Error("info: one of --robot and --model is needed");
  a.output.check();
  RobotOption source = a.robot;
  if (source.path.empty()) source.path = a.model;
  const InfoReport report = run(InfoJob{source.read(a.output).robot, a.rotor_inertia});
  a.output.write(to_json(report));
  if (a.output.summary()) print(std::cout, report);
}

}  // namespace

void add_info(CLI::App& app, int& status) {
  auto a = std::make_shared<InfoArguments>();
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
    run_info(*a);
    status = 0;
  });
}

}  // namespace dynid
