// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/reverse.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption robot;
  std::string samples, out;
  double prune = 30.0;
};

void run(const Arguments& a) {
  const Stopwatch watch;
  a.output.check({a.out});
  const Robot robot = a.robot.read(a.output).robot;
  ReverseOptions options;
  options.prune_percent = a.prune;
  const ReverseIdentification id =
      reverse_engineer(robot, read_model_samples(a.samples, robot.size()), options);
  if (!a.out.empty()) write_model(a.out, {id.robot, id.coefficients, "reverse engineered from " + a.samples});
  const bool consistent = inconsistencies(id.robot).empty();
  a.output.write({{"rank", id.rank},
                  {"condition_number", id.condition_number},
                  {"relative_error_percent", id.relative_error_percent},
                  {"rmse", to_json(id.rmse)},
                  {"rmse_inertia", to_json(id.rmse_inertia)},
                  {"validation",
                   {{"source", "every fifth sample, left out of a second fit"},
                    {"rmse", to_json(id.validation_rmse)},
                    {"relative_error_percent", id.validation_relative_error_percent}}},
                  {"physically_consistent", consistent},
                  {"coefficients", to_json(id.coefficients)},
                  {"seconds", watch.seconds()}});
  if (!a.output.summary()) return;
  std::cout << "Reverse engineered " << id.rank << " coefficients of " << robot.name << " (Section IV-A)\n"
            << "  condition number " << id.condition_number << ", relative error "
            << id.relative_error_percent << " % (held out " << id.validation_relative_error_percent << " %)\n"
            << "  rms of gravity torques [N m]     " << in_a_row(id.rmse) << "\n"
            << "  rms of inertia rows [kg m^2]     " << in_a_row(id.rmse_inertia) << "\n";
  print(std::cout, id.coefficients);
  std::cout << "The standard parameters nearest " << a.robot.path << " that have these coefficients are "
            << (consistent ? "physically consistent.\n" : "not physically consistent: see dynid retrieve.\n");
  if (!a.out.empty()) std::cout << "Model written to " << a.out << "\n";
}

}  // namespace

void add_reverse(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "reverse", "Dynamic coefficients from numerical values of M(q) and g(q) of a controller");
  a->robot.add_to(*command);
  command->add_option("--samples", a->samples, "CSV: q1..qn, m11, m21, m22, ..., g1..gn")
      ->required()
      ->type_name("FILE");
  command->add_option("--out", a->out, "Model to write (YAML)")->type_name("FILE");
  command
      ->add_option("--prune", a->prune,
                   "Drop coefficients whose standard deviation exceeds this many percent; 0: none")
      ->check(CLI::NonNegativeNumber);
  a->output.add_to(*command);
  command->footer(
      "Example: dynid reverse --robot config/panda.yaml --samples model_samples.csv --out reversed.yaml");
  command->callback([a, &status] {
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
