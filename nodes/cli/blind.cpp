// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/blind.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

struct BlindArguments {
  Output output;
  RobotOption model;
  BlindOptions options;
  std::string calibration;           // file to write
  std::vector<std::string> earlier;  // banks that it is fitted to as well
  bool servo = false;
};

void run_blind(const BlindArguments& a) {
  BlindJob job;
  job.options = a.options;
  job.options.family = a.options.family || a.options.given_robot;
  check_options(job);
  if (a.servo && !a.calibration.empty())
    throw Error("blind: --calibrate is of torque logs: a diagnosis of servo logs is not calibrated");
  a.output.check({a.calibration});
  Output silent = a.output;
  silent.quiet = true;
  job.nominal = a.model.read(silent).robot;
  BlindReport report;
  {
    Progress progress(a.output);
    report = a.servo ? run_servos(job, progress.context()) : run(job, progress.context());
  }
  if (!a.calibration.empty()) write_file(a.calibration, report.calibration(a.earlier));
  a.output.write(to_json(report));
  if (a.output.summary()) print(std::cout, report);
}

}  // namespace

void add_blind(CLI::App& app, int& status) {
  auto a = std::make_shared<BlindArguments>();
  CLI::App* command =
      app.add_subcommand("blind", "Diagnose a bank of simulated robots whose effects are withheld");
  a->model.path = "config/panda.yaml";
  a->model.add_to(*command, "--model", false);
  command->add_option("--cases", a->options.cases, "Cases")->required();
  command->add_option("--seed", a->options.seed, "Of the bank")->capture_default_str();
  command
      ->add_option(
          "--kind", a->options.kind,
          "clean; nominal: parameters off by 2 %, coloured noise, jitter; weak: effects at 0.3 x; vendor: no "
          "friction, no rotors, inertials off by 5 and 10 %; mixed: the first three in turn")
      ->transform(CLI::CheckedTransformer(blind_kinds()))
      ->type_name("KIND");
  CLI::Option* const family = command->add_flag("--family", a->options.family,
                                                "An arm, a motion and a rate of its own for each case");
  command
      ->add_flag("--motions", a->options.given_robot,
                 "A motion, a rate and a length of its own for each case, all of the arm of --model")
      ->excludes(family);
  command->add_flag("--servo", a->servo,
                    "Servo logs: commands and positions, no torque; each case has servos of its own");
  command->add_option("--folder", a->options.folder, "Keep the logs, and apart from them the labels, here")
      ->type_name("FOLDER");
  CLI::Option* const calibrate = command
                                     ->add_option("--calibrate", a->calibration,
                                                  "Fit what makes probabilities and intervals mean what they "
                                                  "say to this bank, and write it (YAML; "
                                                  "config/diagnosis_calibration.yaml is built in)")
                                     ->type_name("FILE");
  command
      ->add_option("--with", a->earlier,
                   "Earlier banks that the calibration is fitted to as well: what --json wrote of them")
      ->check(CLI::ExistingFile)
      ->type_name("LIST.json")
      ->needs(calibrate);
  a->output.add_to(*command);
  command->footer("Example: dynid blind --cases 200 --seed 7 --kind nominal --json blind.json");
  command->callback([a, &status] {
    run_blind(*a);
    status = 0;
  });
}

}  // namespace dynid
