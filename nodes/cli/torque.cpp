// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/torque.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"

namespace dynid {
namespace {

struct TorqueArguments {
  Output output;
  RobotOption model;
  LogOption input;
  std::string log, out;
  double cutoff = 0.0;
};

void run_torque(const TorqueArguments& a) {
  TorqueJob job;
  job.cutoff = a.cutoff;
  check_options(job);
  a.output.check({a.out});
  if (is_bag(a.out)) throw Error(a.out + ": --out is a CSV file, not a bag");
  Output silent = a.output;  // whether its links are possible bodies is not the question here
  silent.quiet = true;
  job.robot = a.model.read(silent).robot;
  job.log = a.input.read(a.log, job.robot, torque_columns());
  Progress progress(a.output);
  const TorqueReport report = run(job, progress.context());
  const Table table = report.table();
  write_table(a.out, table.names, table.values);
  nlohmann::json result = to_json(report);
  result["out"] = a.out;
  a.output.write(result);
  if (a.output.summary()) print(std::cout, report, a.out);
}

}  // namespace

void add_torque(CLI::App& app, int& status) {
  auto a = std::make_shared<TorqueArguments>();
  CLI::App* command = app.add_subcommand("torque", "Torques that a model predicts along a recorded motion");
  a->model.add_to(*command, "--model");
  a->model.allow_inconsistent = true;
  command
      ->add_option("--log", a->log,
                   "Motion (CSV: t, q1.., dq1..; with ddq1.. it is taken as it stands; or .bag)")
      ->required()
      ->type_name("FILE");
  a->input.add_to(*command);
  command->add_option("--out", a->out, "CSV to write: t, tau1.., tauf1..")->required()->type_name("FILE");
  command->add_option("--cutoff", a->cutoff,
                      "Cut-off of the zero-phase low-pass filter of the motion [Hz]; 0: chosen");
  a->output.add_to(*command);
  command->footer("Example: dynid torque --model identified.yaml --log exciting.csv --out torque.csv");
  command->callback([a, &status] {
    run_torque(*a);
    status = 0;
  });
}

}  // namespace dynid
