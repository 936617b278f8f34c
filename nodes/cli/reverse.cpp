// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/reverse.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

struct ReverseArguments {
  Output output;
  RobotOption robot;
  std::string samples, out;
  ReverseOptions options;
};

void run_reverse(const ReverseArguments& a) {
  ReverseJob job;
  job.options = a.options;
  check_options(job);
  a.output.check({a.out});
  job.robot = a.robot.read(a.output).robot;
  job.source = a.robot.path;
  job.samples = read_model_samples(a.samples, job.robot.size());
  Progress progress(a.output);
  const ReverseReport report = run(job, progress.context());
  if (!a.out.empty()) write_model(a.out, report.model());
  a.output.write(to_json(report));
  if (!a.output.summary()) return;
  print(std::cout, report);
  if (!a.out.empty()) std::cout << "Model written to " << a.out << "\n";
}

}  // namespace

void add_reverse(CLI::App& app, int& status) {
  auto a = std::make_shared<ReverseArguments>();
  CLI::App* command = app.add_subcommand(
      "reverse", "Dynamic coefficients from numerical values of M(q) and g(q) of a controller");
  a->robot.add_to(*command);
  command->add_option("--samples", a->samples, "CSV: q1..qn, m11, m21, m22, ..., g1..gn")
      ->required()
      ->type_name("FILE");
  command->add_option("--out", a->out, "Model to write (YAML)")->type_name("FILE");
  command->add_option("--prune", a->options.prune_percent,
                      "Drop coefficients whose standard deviation exceeds this many percent; 0: none");
  a->output.add_to(*command);
  command->footer(
      "Example: dynid reverse --robot config/panda.yaml --samples model_samples.csv --out reversed.yaml");
  command->callback([a, &status] {
    run_reverse(*a);
    status = 0;
  });
}

}  // namespace dynid
