// SPDX-License-Identifier: Apache-2.0
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/identification/servo.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption model;
  LogOption input;
  std::string log, out;
};

void run(const Arguments& a) {
  a.output.check({a.out});
  if (is_bag(a.out)) throw Error(a.out + ": --out is a CSV file, not a bag");
  Output silent = a.output;  // whether its links are possible bodies is not the question here
  silent.quiet = true;
  const Robot robot = a.model.read(silent).robot;
  const int n = robot.size();
  LogColumns required;
  required.dq = required.tau = false;
  const Log log = a.input.read(a.log, robot, required);
  const ServoReplay replay = replay_servos(robot, log);
  if (!a.out.empty()) {
    std::vector<std::string> names = {"t"};
    for (const char* prefix : {"q", "dq"})
      for (const std::string& name : column_names(prefix, n)) names.push_back(name);
    Eigen::MatrixXd values(log.samples(), 1 + 2 * n);
    values << replay.t, replay.q, replay.dq;
    write_table(a.out, names, values);
  }
  const Eigen::VectorXd tracking = (log.u - log.q).cwiseAbs().colwise().mean().transpose();
  a.output.write({{"samples", log.samples()},
                  {"error", to_json(replay.error)},
                  {"mean_error", replay.error.mean()},
                  {"perfect_tracking_error", to_json(tracking)},
                  {"out", a.out}});
  if (!a.output.summary()) return;
  std::cout << "Open loop from the first of " << log.samples()
            << " samples, mean absolute error of the position\n"
            << "  model [rad]            " << in_a_row(replay.error) << "\n"
            << "  perfect tracking [rad] " << in_a_row(tracking) << "\n";
  if (!a.out.empty()) std::cout << "Motion written to " << a.out << "\n";
}

}  // namespace

void add_replay(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
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
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
