// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/init.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

struct InitArguments {
  Output output;
  InitJob job;
  std::string dh, out;
  std::vector<double> gravity;
};

void run_init(const InitArguments& a) {
  a.output.check({a.out});
  InitJob job = a.job;
  job.dh = read_table(a.dh);
  if (!a.gravity.empty()) job.gravity = Eigen::Map<const Eigen::Vector3d>(a.gravity.data());
  const InitReport report = run(job);
  write_file(a.out, report.text);
  nlohmann::json result = to_json(report);
  result["out"] = a.out;
  a.output.write(result);
  if (a.output.summary())
    std::cout << report.robot.size() << " joints written to " << a.out
              << ": open it, and put in what you know of the robot\n";
}

}  // namespace

void add_init(CLI::App& app, int& status) {
  auto a = std::make_shared<InitArguments>();
  CLI::App* command = app.add_subcommand(
      "init", "Write a model with comments, to go on from, for a Denavit-Hartenberg table");
  command
      ->add_option("--dh", a->dh,
                   "The table (CSV): columns a [m], alpha [rad], d [m], theta [rad], a row for each joint")
      ->required()
      ->type_name("FILE");
  command
      ->add_option(
          "--convention", a->job.convention,
          "modified: Rx(alpha) Tx(a) Rz(theta + q) Tz(d) (Khalil, Craig); standard: Rz(theta + q) Tz(d) "
          "Tx(a) Rx(alpha) (Denavit, Spong)")
      ->transform(CLI::CheckedTransformer(dh_conventions()))
      ->type_name("modified|standard")
      ->default_str("modified");
  command->add_flag("--degrees", a->job.degrees, "alpha and theta are in degrees");
  command
      ->add_option("--types", a->job.types,
                   "A letter for each joint: R turns, P slides, C turns without limits; usually all R")
      ->type_name("RRP...");
  command->add_option("--names", a->job.joint_names, "Names of the joints")
      ->delimiter(',')
      ->type_name("NAME,...");
  command->add_option("--name", a->job.name, "Name of the robot")->capture_default_str();
  command->add_option("--gravity", a->gravity, "How the arm is mounted: gravity in the base frame [m/s^2]")
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,Z");
  command->add_option("--out", a->out, "Model to write (YAML)")->required()->type_name("FILE");
  a->output.add_to(*command);
  command->footer("Example: dynid init --dh table.csv --degrees --name arm --out arm.yaml");
  command->callback([a, &status] {
    run_init(*a);
    status = 0;
  });
}

}  // namespace dynid
