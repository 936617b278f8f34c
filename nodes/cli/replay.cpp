// SPDX-License-Identifier: Apache-2.0
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/servo.hpp"
#include "dynid/base/error.hpp"

namespace dynid {
namespace {

struct ReplayArguments {
  Output output;
  RobotOption model;
  LogOption input;
  std::string log, out;
};

void run_replay(const ReplayArguments& a) {
  a.output.check({a.out});
  if (is_bag(a.out)) throw Error(a.out + ": --out is a CSV file, not a bag");
  Output silent = a.output;  // whether its links are possible bodies is not the question here
  silent.quiet = true;
  ReplayJob job;
  job.robot = a.model.read(silent).robot;
  job.log = a.input.read(a.log, job.robot, servo_columns());
  Progress progress(a.output);
  const ReplayReport report = run(job, progress.context());
  if (!a.out.empty()) {
    const Table table = report.table();
    write_table(a.out, table.names, table.values);
  }
  nlohmann::json result = to_json(report);
  result["out"] = a.out;
  a.output.write(result);
  if (!a.output.summary()) return;
  print(std::cout, report);
  if (!a.out.empty()) std::cout << "Motion written to " << a.out << "\n";
}

}  // namespace

void add_replay(CLI::App& app, int& status) {
  auto a = std::make_shared<ReplayArguments>();
  CLI::App* command =
      app.add_subcommand("replay", "The motion that a model with servos makes of a log's commands");
  a->model.add_to(*command, "--model");
  a->model.allow_inconsistent = true;
  command->add_option("--log", a->log, "Commands and positions (CSV: t, u1.., q1..; or .bag)")
      ->required()
      ->type_name("FILE");
  a->input.add_to(*command);
  command->add_option("--out", a->out, "CSV to write: t, q1.., dq1..")->type_name("FILE");
  a->output.add_to(*command);
  command->footer("Example: dynid replay --model servos.yaml --log step_response.csv --out motion.csv");
  command->callback([a, &status] {
    run_replay(*a);
    status = 0;
  });
}

}  // namespace dynid
