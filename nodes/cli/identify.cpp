// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/identify.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/app/friction.hpp"
#include "dynid/app/servo.hpp"
#include "dynid/app/uncertainty.hpp"
#include "dynid/base/error.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

struct IdentifyArguments {
  Output output;
  RobotOption robot;
  LogOption input;
  std::vector<std::string> logs, validation;
  std::string assume, out;
  bool friction_only = false;
  bool servo = false;
  IdentifyOptions options;
};

/// Model, JSON and summary of what was made.
template <class Report>
void write(const IdentifyArguments& a, const Report& report, const LearntUncertainty& learnt = {}) {
  if (!a.out.empty()) write_model(a.out, report.model(), learnt.uncertainty);
  a.output.write(to_json(report));
  if (!a.output.summary()) return;
  print(std::cout, report);
  if (!learnt.note.empty()) std::cout << "Without the residual's uncertainty: " << learnt.note << "\n";
  if (!a.out.empty()) std::cout << "Model written to " << a.out << "\n";
}

void identify_servo(const IdentifyArguments& a) {
  a.output.check({a.out});
  IdentifyServosJob job;
  if (!a.robot.path.empty()) job.robot = a.robot.read(a.output).robot;
  Progress progress(a.output);
  job.logs = read_logs(a.input, a.logs, job.robot.value_or(Robot()), progress, servo_columns());
  write(a, run(job, progress.context()));
}

void run_identify(const IdentifyArguments& a) {
  if (a.servo) return identify_servo(a);
  if (a.robot.path.empty()) throw Error("--robot is required (it is optional with --servo only)");
  IdentifyJob job;
  job.options = a.options;
  check_options(job);
  a.output.check({a.out});
  job.robot = a.robot.read(a.output).robot;
  job.source = a.robot.path;
  job.assume = a.assume;
  Progress progress(a.output);
  job.logs = read_logs(a.input, a.logs, job.robot, progress);
  if (a.friction_only)
    return write(
        a, run(FrictionJob{job.robot, job.source, job.logs, job.options, job.assume}, progress.context()));
  job.validation = read_logs(a.input, a.validation, job.robot, progress);
  // With a model file, most of the time goes into what the residual strays by: eight more fits.
  const Context context = progress.context();
  const double share = a.out.empty() || !job.validation.empty() ? 1.0 : 0.25;
  const IdentifyReport report = run(job, context.part(0.0, share));
  write(a, report,
        a.out.empty() ? LearntUncertainty() : uncertainty_of(job, report, context.part(share, 1.0)));
}

}  // namespace

void add_identify(CLI::App& app, int& status) {
  auto a = std::make_shared<IdentifyArguments>();
  IdentifyOptions& o = a->options;
  CLI::App* command =
      app.add_subcommand("identify", "Dynamic coefficients and friction from recorded motions");
  a->robot.add_to(*command, "--robot", false);
  command->add_flag("--servo", a->servo,
                    "Position servos from commanded and measured positions (CSV: t, u1.., q1..)");
  command
      ->add_option("--assume", a->assume, "How to read the logs: auto, or KEY=VALUE,... as diagnose proposes")
      ->type_name("auto|KEY=VALUE,...");
  command->add_option("--log", a->logs, "Logs to fit (CSV: t, q1.., dq1.., tau1..; or .bag)")
      ->required()
      ->type_name("FILE...");
  command->add_option("--validate", a->validation, "Logs to predict, never fitted")->type_name("FILE...");
  a->input.add_to(*command);
  command->add_option("--out", a->out, "Model to write (YAML)")->type_name("FILE");
  command->add_option("--cutoff", o.prepare.cutoff,
                      "Cut-off of the zero-phase low-pass filter [Hz]; chosen when not given, or 0");
  command
      ->add_option("--friction", o.friction,
                   "Joint friction: eq. (24), eq. (25) where it predicts better, or none")
      ->transform(CLI::CheckedTransformer(friction_laws(), CLI::ignore_case))
      ->type_name("none|linear|sigmoid");
  command->add_flag("--rotor-inertia", o.rotor_inertia, "Identify reflected rotor inertias too");
  command
      ->add_option("--method", o.method, "Least squares: ordinary, weighted by joint, iteratively reweighted")
      ->transform(CLI::CheckedTransformer(methods(), CLI::ignore_case))
      ->type_name("ols|wls|irls");
  command
      ->add_option("--motion", o.prepare.source,
                   "What accelerations are differentiated from; by default the quieter one")
      ->transform(CLI::CheckedTransformer(motion_sources(), CLI::ignore_case))
      ->type_name("auto|velocity|position");
  command->add_option("--prune", o.prune_percent,
                      "Drop coefficients whose standard deviation exceeds this many percent; 0: none");
  command->add_flag(
      "--friction-only", a->friction_only,
      "Keep the robot's rigid-body parameters and fit friction to the differences (Section IV-B)");
  a->output.add_to(*command);
  command->footer(
      "Example: dynid identify --robot config/panda.yaml --log exciting.csv --out identified.yaml\n"
      "         dynid identify --servo --log chirp.csv multisine.csv --out servos.yaml");
  command->callback([a, &status] {
    run_identify(*a);
    status = 0;
  });
}

}  // namespace dynid
