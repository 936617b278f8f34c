// SPDX-License-Identifier: Apache-2.0
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/model/export.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption model;
  std::string format, out, into;
};

ExportText exported(const Robot& robot, const Arguments& a) {
  if (a.format == "mjcf") return to_mjcf(robot);
  if (a.format == "sdf") return to_sdf(robot);
  if (a.format == "franka") return to_franka_inertials(robot);
  if (a.format == "header") return to_header(robot);
  const UrdfText urdf = a.into.empty() ? to_urdf(robot) : update_urdf(read_file(a.into), a.into, robot);
  return {urdf.text, urdf.not_expressed};
}

void run(const Arguments& a) {
  a.output.check({a.out});
  if (!a.into.empty() && a.format != "urdf") throw Error("export: --into goes with --format urdf");
  const ModelFile model = a.model.read(a.output);
  std::vector<std::string> not_expressed;
  if (a.format == "yaml") {
    write_model(a.out, model);
  } else {
    const ExportText text = exported(model.robot, a);
    write_file(a.out, text.text);
    not_expressed = text.not_expressed;
  }
  a.output.write({{"format", a.format}, {"out", a.out}, {"not_expressed", not_expressed}});
  if (!a.output.summary()) return;
  std::cout << model.robot.name << " written to " << a.out << "\n";
  for (const std::string& what : not_expressed) std::cout << "  not expressed: " << what << "\n";
}

}  // namespace

void add_export(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("export", "Write a model for another program");
  a->model.add_to(*command, "--model");
  command
      ->add_option("--format", a->format,
                   "urdf, mjcf (MuJoCo), sdf (Gazebo), yaml (this program's), header (C++) or franka (the "
                   "inertials that franka_description reads)")
      ->required()
      ->check(CLI::IsMember({"urdf", "mjcf", "sdf", "yaml", "header", "franka"}));
  command
      ->add_option("--into", a->into,
                   "With urdf: a URDF whose inertials and joint dynamics are replaced, the rest untouched")
      ->type_name("FILE");
  command->add_option("--out", a->out, "File to write")->required()->type_name("FILE");
  a->output.add_to(*command);
  command->footer("Example: dynid export --model config/panda.yaml --format urdf --out panda.urdf");
  command->callback([a, &status] {
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
