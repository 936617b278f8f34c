// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/demo.hpp"

#include <filesystem>
#include <iostream>
#include <optional>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/simulate.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/text.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

struct DemoArguments {
  Output output;
  std::string robot = "config/panda.yaml", bounds = "config/panda_bounds.yaml", out = "demo";
  std::vector<std::string> effects = {"joint_spring:joints=2,stiffness=20"};
  unsigned long seed = 1;
};

std::string command_line(const DemoArguments& a) {
  std::string line = "dynid demo";
  for (const std::string& effect : a.effects) line += " --effect " + shell_quoted(effect);
  return line + " --seed " + std::to_string(a.seed) + " --out " + shell_quoted(a.out);
}

bool run_demo(const DemoArguments& a) {
  std::error_code error;
  std::filesystem::create_directories(a.out, error);
  if (error) throw Error(a.out + ": cannot be made: " + error.message());
  a.output.check();
  const auto path = [&a](const char* name) { return a.out + "/" + name; };
  DemoJob job;
  job.robot = read_model_file(a.robot).robot;
  job.source = a.robot;
  job.log = path("log.csv");
  job.seed = a.seed;
  job.bounds = read_bounds(a.bounds);
  if (a.effects != std::vector<std::string>{"none"}) job.effects = parse_effects(a.effects, job.robot);
  job.runs = {path("run1.csv"), path("run2.csv")};
  Progress progress(a.output);
  const DemoReport report = run(job, progress.context());
  const std::string page = path("report.html"), html = report.html(command_line(a), DYNID_VERSION);
  write_log(job.log, report.log);
  write_model(path("identified.yaml"), report.model());
  write_model(path("feasible.yaml"), report.retrieval.model());
  const Table torques = report.torques();
  write_table(path("torque.csv"), torques.names, torques.values);
  for (std::size_t k = 0; k < report.runs.size(); ++k) write_log(job.runs[k], report.runs[k]);
  const std::optional<ModelFile> patch = report.diagnosis.patch();
  if (patch) write_model(path("patched.yaml"), *patch);
  write_file(page, html);
  nlohmann::json result = to_json(report);
  result["report"] = page;
  a.output.write(result);
  if (a.output.summary()) {
    print(std::cout, report);
    std::cout << "Models: " << path("identified.yaml") << ", " << path("feasible.yaml")
              << (patch ? ", " + path("patched.yaml") : "") << "\nReport: " << page << "\n";
  }
  return report.succeeded();
}

}  // namespace

void add_demo(CLI::App& app, int& status) {
  auto a = std::make_shared<DemoArguments>();
  CLI::App* command = app.add_subcommand(
      "demo",
      "Excite, identify, make feasible and diagnose a simulated Panda that hides an effect; write a page");
  command->add_option("--effect", a->effects, "What it hides, NAME[:key=value,...], or none; may be repeated")
      ->type_name("EFFECT")
      ->capture_default_str();
  command->add_option("--robot", a->robot, "The published Panda")->type_name("FILE")->capture_default_str();
  command->add_option("--bounds", a->bounds, "Bounds of its parameters")
      ->type_name("FILE")
      ->capture_default_str();
  command->add_option("--out", a->out, "Folder for the logs, the models and the report")
      ->type_name("FOLDER")
      ->capture_default_str();
  command->add_option("--seed", a->seed, "Seed of noise and motions")->capture_default_str();
  a->output.add_to(*command);
  command->footer("Example: dynid demo --effect payload:mass=1.5 --out demo");
  command->callback([a, &status] { status = run_demo(*a) ? 0 : 1; });
}

}  // namespace dynid
