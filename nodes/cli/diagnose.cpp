// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/diagnose.hpp"
#include "dynid/app/servo_diagnosis.hpp"
#include "dynid/app/uncertainty.hpp"

#include <filesystem>
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/fleet.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/diagnosis/calibration.hpp"
#include "dynid/model/model_warning.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/retrieval/mpi.hpp"

namespace dynid {
namespace {

struct DiagnoseArguments {
  Output output;
  RobotOption model;
  LogOption input;
  std::vector<std::string> logs, withhold;
  std::string assume, reference, calibration, patch, report, next_trajectory, fleet, folder;
  DiagnoseOptions options;
};

/// The command that makes this diagnosis again.
std::string command_line(const DiagnoseArguments& a) {
  DiagnoseCommand command;
  command.model = a.model.path;
  command.base = a.model.base;
  command.tip = a.model.tip;
  command.logs = a.logs;
  command.reference = a.reference;
  if (a.input.topic != LogOption().topic) command.topic = a.input.topic;
  command.withhold = a.withhold;
  command.calibration = a.calibration;
  command.assume = a.assume;
  for (const double x : a.model.gravity)
    command.gravity += (command.gravity.empty() ? "" : ",") + exact_number(x);
  command.columns = a.input.columns;
  command.rate = a.input.rate;
  command.cutoff = a.options.cutoff;
  command.tolerance = a.options.tolerance;
  command.seed = a.options.seed;
  command.patch = a.patch;
  command.next_trajectory = a.next_trajectory;
  command.report = a.report;
  return command.line();
}

/// What is odd about the model, on standard error.
void warn_of(const Robot& model, const DiagnoseArguments& a) {
  if (a.output.quiet) return;
  for (const ModelWarning& warning : check_model(model))
    std::cerr << "dynid: warning: " << a.model.path << ": " << warning.text << "\n";
}

/// Which state of a file a kept diagnosis was made with; empty for none.
std::string state_of(const std::string& path) {
  if (path.empty()) return "";
  return std::to_string(std::filesystem::file_size(path)) + " " +
         std::to_string(std::filesystem::last_write_time(path).time_since_epoch().count()) + "\n";
}

/// The folder of a fleet's diagnoses, where none is named: beside the table, until all are done.
std::string usual_folder(const std::string& table) { return table + ".diagnoses"; }

std::string fleet_command_line(const DiagnoseArguments& a) {
  std::string line = command_line(a);
  const std::string none = " --log";
  line.replace(line.find(none), none.size(), " --fleet " + shell_quoted(a.fleet));
  if (!a.folder.empty()) line += " --folder " + shell_quoted(a.folder);
  return line;
}

int run_fleet(const DiagnoseArguments& a, const DiagnoseJob& each) {
  if (!a.patch.empty() || !a.next_trajectory.empty())
    throw Error("diagnose: --patch and --next-trajectory are of one robot, not of a --fleet");
  const MpiRanks ranks;
  const bool first = ranks.rank() == 0;
  Output output = a.output;
  if (!first) output.quiet = true;
  output.check({a.report});
  Output silent = output;
  silent.quiet = true;
  FleetJob job;
  job.members = read_fleet(a.fleet);
  job.each = each;
  const ModelFile model = a.model.read(silent);
  job.each.nominal = model.robot;
  if (first) warn_of(model.robot, a);
  if (!a.reference.empty()) job.each.reference = a.input.read(a.reference, model.robot);
  job.read = [&](const std::string& path) { return a.input.read(path, model.robot); };
  job.folder = a.folder.empty() ? usual_folder(a.fleet) : a.folder;
  DiagnoseArguments what = a;  // where it is written to does not change it
  what.report.clear();
  what.folder.clear();
  job.inputs = std::string(DYNID_VERSION) + " " + fleet_command_line(what) + "\n" + state_of(a.reference) +
               state_of(a.calibration) + to_yaml(model);
  job.rank = ranks.rank();
  job.ranks = ranks.ranks();
  job.gather = [&](std::vector<std::string>& texts) { ranks.gather_texts(texts); };
  Progress progress(output);
  const FleetReport report = run(job, progress.context());
  if (!first) return 0;  // it is for the first to say; mpirun ends all where one fails
  const int status = report.succeeded() ? 0 : 1;
  if (!a.report.empty()) write_file(a.report, report.html(fleet_command_line(a), DYNID_VERSION));
  output.write(to_json(report));
  std::error_code kept;  // what remains is of no harm
  if (a.folder.empty() && report.succeeded()) std::filesystem::remove_all(job.folder, kept);
  if (!output.summary()) return status;
  print(std::cout, report);
  if (!a.report.empty()) std::cout << "Report: " << a.report << "\n";
  return status;
}

int run_diagnose(const DiagnoseArguments& a) {
  DiagnoseJob job;
  job.options = a.options;
  job.withhold = a.withhold;
  job.assume = a.assume;
  check_options(job);
  Calibration calibration;  // to outlive the job
  if (!a.calibration.empty()) {
    calibration = read_calibration(a.calibration);
    job.options.calibration = &calibration;
  }
  if (a.logs.empty() == a.fleet.empty()) throw Error("diagnose: --log or --fleet is needed, one of them");
  if (!a.fleet.empty()) return run_fleet(a, job);
  if (!a.folder.empty()) throw Error("diagnose: --folder goes with --fleet");
  a.output.check({a.patch, a.report, a.next_trajectory});
  Output silent = a.output;
  silent.quiet = true;
  job.nominal = a.model.read(silent).robot;
  warn_of(job.nominal, a);
  Progress progress(a.output);
  if (!a.reference.empty())
    job.reference = a.input.read(a.reference, job.nominal, diagnosis_columns(job.nominal));
  job.logs = read_logs(a.input, a.logs, job.nominal, progress, diagnosis_columns(job.nominal));
  const DiagnoseReport report = run(job, progress.context());

  nlohmann::json result = to_json(report);
  const std::string page = a.report.empty() ? "" : report.html(command_line(a), DYNID_VERSION);
  if (const auto patch = report.patch(); patch && !a.patch.empty())
    write_model(a.patch, *patch, uncertainty_of(job, report).uncertainty);
  if (const Trajectory& next = report.diagnosis.next.motion;
      !a.next_trajectory.empty() && next.samples() > 0) {
    write_trajectory(a.next_trajectory, next);
    result["next_experiment"]["trajectory"] = a.next_trajectory;
  }
  if (!page.empty()) write_file(a.report, page);
  a.output.write(result);
  if (a.output.summary()) print(std::cout, report);
  return report.succeeded() ? 0 : 1;
}

}  // namespace

void add_diagnose(CLI::App& app, int& status) {
  auto a = std::make_shared<DiagnoseArguments>();
  CLI::App* command = app.add_subcommand(
      "diagnose", "Where a model and a robot disagree, which effect makes it, and how far it shrinks");
  a->model.add_to(*command, "--model");
  a->model.allow_inconsistent = true;
  command
      ->add_option(
          "--log", a->logs,
          "Logs of the robot (CSV: torques, or commands u1.. where the model has servos); of several, "
          "the last only judges")
      ->type_name("FILE...");
  command
      ->add_option(
          "--fleet", a->fleet,
          "Instead of --log: a table (CSV: robot, log, log2...) of many robots of this model; one JSON "
          "and one page for all. Begun again after a stop, it goes on where it was")
      ->type_name("TABLE");
  command
      ->add_option(
          "--folder", a->folder,
          "Of a fleet: keeps each robot's diagnosis, for the next run (TABLE.diagnoses until all are done)")
      ->type_name("FOLDER");
  command->add_option("--reference", a->reference, "Log of the healthy robot: says how far the model is off")
      ->type_name("FILE");
  a->input.add_to(*command);
  command
      ->add_option("--assume", a->assume,
                   "How to read the logs: auto, or what a diagnosis that called them misread proposes")
      ->type_name("auto|KEY=VALUE,...");
  command->add_option("--withhold", a->withhold,
                      "Take friction or payload out of the model, or an effect out of the library");
  command->add_option("--patch", a->patch, "Model to write, with the effects in it (YAML)")
      ->type_name("FILE");
  command
      ->add_option("--calibration", a->calibration,
                   "What makes probabilities and intervals mean what they say, of another bank than the one "
                   "that is built in (YAML, written by blind --calibrate)")
      ->type_name("FILE");
  command
      ->add_option("--report", a->report,
                   "Page to write: what was found, in words, figures and plots (HTML, self-contained)")
      ->type_name("FILE");
  command
      ->add_option("--next-trajectory", a->next_trajectory,
                   "Motion to write that tells apart the effects that these logs cannot (CSV)")
      ->type_name("FILE");
  command->add_option("--cutoff", a->options.cutoff, "Band looked at [Hz]; 0: chosen");
  command
      ->add_option("--tolerance", a->options.tolerance,
                   "Relative error of the model's parameters that is no gap")
      ->capture_default_str();
  command->add_option("--seed", a->options.seed, "Of surrogates and intervals")->capture_default_str();
  a->output.add_to(*command);
  command->footer(
      "Example: dynid diagnose --model config/panda.yaml --log a.csv b.csv --patch patched.yaml "
      "--report report.html");
  command->callback([a, &status] { status = run_diagnose(*a); });
}

}  // namespace dynid
