// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/retrieve.hpp"

#include <iostream>
#include <optional>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/model/uncertainty.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/retrieval/mpi.hpp"

namespace dynid {
namespace {

struct RetrieveArguments {
  Output output;
  RobotOption model;
  LogOption input;
  std::vector<std::string> logs;
  std::string robot, bounds, out, prior;
  double cutoff = 0.0;
  bool weighted = false;
  RetrievalOptions options;
};

int run_retrieve(const RetrieveArguments& a) {
  RetrieveJob job;
  job.cutoff = a.cutoff;
  job.weighted = a.weighted;
  job.options = a.options;
  job.keep_best_when_stopped = true;
  check_options(job);
  const MpiRanks ranks;
  const bool first = ranks.rank() == 0;
  Output output = a.output;
  if (!first) output.quiet = true;
  output.check({a.out});
  if (a.logs.empty() == a.model.path.empty() && a.robot.empty())
    throw Error("retrieve: --model with coefficients, or --log with --robot, is needed");
  if (!a.logs.empty() && a.robot.empty() && a.model.path.empty())
    throw Error("retrieve: --log needs --robot, for the kinematics");

  RobotOption source = a.model;
  if (source.path.empty()) source.path = a.robot;
  source.allow_inconsistent = true;  // to make it consistent is what is asked for
  Output silent = output;
  silent.quiet = true;
  job.model = source.read(silent);
  job.source = a.model.path;
  job.bounds = read_bounds(a.bounds);
  if (!a.prior.empty()) job.prior = read_robot(a.prior, a.model.base, a.model.tip);
  Progress progress(output);
  job.logs = read_logs(a.input, a.logs, job.model.robot, progress);
  ranks.share(job.options);
  const RetrieveReport report = run(job, progress.context());
  const int status = report.succeeded() ? 0 : 1;
  if (!first) return status;

  const bool written = report.succeeded() && !a.out.empty();
  // The coefficients stay what they were, and so does what their residual strays by.
  if (written)
    write_model(a.out, report.model(),
                a.logs.empty() && !a.model.path.empty() ? read_uncertainty(a.model.path) : std::nullopt);
  output.write(to_json(report));
  if (!output.summary()) return status;
  print(std::cout, report);
  if (written) std::cout << "Model written to " << a.out << "\n";
  return status;
}

}  // namespace

void add_retrieve(CLI::App& app, int& status) {
  auto a = std::make_shared<RetrieveArguments>();
  CLI::App* command = app.add_subcommand(
      "retrieve", "Feasible masses, centres of mass and inertias from coefficients or a log");
  a->model.add_to(*command, "--model", false);
  command->add_option("--log", a->logs, "One step: fit feasible parameters and eq. (24) to these logs")
      ->type_name("FILE...");
  a->input.add_to(*command);
  command->add_option("--robot", a->robot, "Kinematics for --log (URDF or YAML)")->type_name("FILE");
  command->add_option("--bounds", a->bounds, "Bounds and constraints (YAML, dynid-bounds-1)")
      ->required()
      ->type_name("FILE");
  command->add_option("--out", a->out, "Model to write (YAML)")->type_name("FILE");
  command->add_option("--runs", a->options.runs, "Q: independent runs of Algorithm 1")->capture_default_str();
  command->add_option("--steps", a->options.steps, "kappa: steps of a run")->capture_default_str();
  command->add_option("--seed", a->options.seed, "Seed of the first run")->capture_default_str();
  command->add_option("--threads", a->options.threads, "0: all cores")->capture_default_str();
  command
      ->add_option("--agree", a->options.agreeing_runs,
                   "Stop once this many runs agree on the objective; 0: never")
      ->capture_default_str();
  command->add_flag("--weighted", a->weighted, "Weight the coefficients by their standard deviations");
  command->add_option("--prior", a->prior, "Known parameters to stay close to among equals (URDF or YAML)")
      ->type_name("FILE");
  command->add_option("--cutoff", a->cutoff, "With --log: cut-off of the low-pass filter [Hz]; 0: chosen");
  a->output.add_to(*command);
  command->footer(
      "Ctrl-C ends the runs; the best set until then is written, and the JSON says `interrupted`.\n"
      "Example: dynid retrieve --model reversed.yaml --bounds config/panda_bounds.yaml --out feasible.yaml");
  command->callback([a, &status] { status = run_retrieve(*a); });
}

}  // namespace dynid
