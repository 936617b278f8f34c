// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/demo.hpp"

#include <filesystem>
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  std::string robot = "config/panda.yaml", out = "demo";
  unsigned long seed = 1;
};

void run(const Arguments& a) {
  std::error_code error;
  std::filesystem::create_directories(a.out, error);
  if (error) throw Error(a.out + ": cannot be made: " + error.message());
  a.output.check();
  const std::string log = a.out + "/log.csv", model = a.out + "/identified.yaml",
                    page = a.out + "/report.html";
  Progress progress(a.output);
  const DemoReport report =
      run(DemoJob{read_model_file(a.robot).robot, a.robot, log, a.seed}, progress.context());
  const std::string html = report.html();
  write_log(log, report.log);
  write_model(model, report.model());
  const Table torques = report.torques();
  write_table(a.out + "/torque.csv", torques.names, torques.values);
  write_file(page, html);
  nlohmann::json result = to_json(report);
  result["report"] = page;
  a.output.write(result);
  if (!a.output.summary()) return;
  print(std::cout, report);
  std::cout << "Model:  " << model << "\nReport: " << page << "\n";
}

}  // namespace

void add_demo(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("demo", "Make a log of the published Panda, identify it, write a report");
  command->add_option("--robot", a->robot, "The published Panda")->type_name("FILE")->capture_default_str();
  command->add_option("--out", a->out, "Folder for the log, the model and the report")
      ->type_name("FOLDER")
      ->capture_default_str();
  command->add_option("--seed", a->seed, "Seed of the log's noise")->capture_default_str();
  a->output.add_to(*command);
  command->footer("Example: dynid demo --out demo");
  command->callback([a, &status] {
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
