// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/export.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

struct ExportArguments {
  Output output;
  RobotOption model;
  ExportFormat format = ExportFormat::urdf;
  std::string out, into;
};

void run_export(const ExportArguments& a) {
  a.output.check({a.out});
  if (!a.into.empty() && a.format != ExportFormat::urdf)
    throw Error("export: --into goes with --format urdf");
  ExportJob job;
  job.model = a.model.read(a.output);
  job.format = a.format;
  if (!a.into.empty()) job.into = ExportJob::Into{read_file(a.into), a.into};
  const ExportReport report = run(job);
  write_file(a.out, report.text);
  nlohmann::json result = to_json(report);
  result["out"] = a.out;
  a.output.write(result);
  if (!a.output.summary()) return;
  std::cout << report.robot << " written to " << a.out << "\n";
  for (const std::string& what : report.not_expressed) std::cout << "  not expressed: " << what << "\n";
}

}  // namespace

void add_export(CLI::App& app, int& status) {
  auto a = std::make_shared<ExportArguments>();
  CLI::App* command = app.add_subcommand("export", "Write a model for another program");
  a->model.add_to(*command, "--model");
  command
      ->add_option("--format", a->format,
                   "urdf, mjcf (MuJoCo), sdf (Gazebo), yaml (this program's), header (C++) or franka (the "
                   "inertials that franka_description reads)")
      ->required()
      ->transform(CLI::CheckedTransformer(export_formats()))
      ->type_name("urdf|mjcf|sdf|yaml|header|franka");
  command
      ->add_option("--into", a->into,
                   "With urdf: a URDF whose inertials and joint dynamics are replaced, the rest untouched")
      ->type_name("FILE");
  command->add_option("--out", a->out, "File to write")->required()->type_name("FILE");
  a->output.add_to(*command);
  command->footer("Example: dynid export --model config/panda.yaml --format urdf --out panda.urdf");
  command->callback([a, &status] {
    run_export(*a);
    status = 0;
  });
}

}  // namespace dynid
