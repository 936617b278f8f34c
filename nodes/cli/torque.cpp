// SPDX-License-Identifier: Apache-2.0
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/diagnosis/effect_prediction.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption model;
  LogOption input;
  std::string log, out;
  double cutoff = 0.0;
};

void run(const Arguments& a) {
  a.output.check({a.out});
  if (is_bag(a.out)) throw Error(a.out + ": --out is a CSV file, not a bag");
  Output silent = a.output;  // whether its links are possible bodies is not the question here
  silent.quiet = true;
  const Robot robot = a.model.read(silent).robot;
  const int n = robot.size();
  LogColumns required;
  required.t = required.dq = required.tau = false;
  const Log log = a.input.read(a.log, robot, required);
  if (log.ddq.size() == 0 && log.t.size() == 0)
    throw Error(a.log + ": column t is missing (it is needed where there is no ddq1..ddq" +
                std::to_string(n) + ")");
  PredictedTorque predicted = predict_torque(robot, log, a.cutoff);
  predicted.tau += predict_effects(robot, log, a.cutoff);

  std::vector<std::string> names = {"t"};
  for (const char* prefix : {"tau", "tauf"})
    for (const std::string& name : column_names(prefix, n)) names.push_back(name);
  Eigen::MatrixXd values(log.samples(), 1 + 2 * n);
  values << predicted.t, predicted.tau, predicted.tau_f;
  write_table(a.out, names, values);

  nlohmann::json result = {{"samples", log.samples()}, {"out", a.out}};
  Eigen::VectorXd rms;
  if (log.tau.size() > 0) {
    rms = ((predicted.tau - log.tau).colwise().squaredNorm() / double(log.samples())).cwiseSqrt().transpose();
    result["rms_difference"] = to_json(rms);
  }
  a.output.write(result);
  if (!a.output.summary()) return;
  std::cout << "Torques of " << robot.name << " at " << log.samples() << " samples written to " << a.out
            << "\n";
  if (rms.size() > 0)
    std::cout << "  rms difference to the log's tau, unfiltered [N m]: " << in_a_row(rms) << "\n";
}

}  // namespace

void add_torque(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
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
  command->add_option("--cutoff", a->cutoff, "Cut-off of the zero-phase low-pass filter of the motion [Hz]")
      ->check(CLI::PositiveNumber);
  a->output.add_to(*command);
  command->footer("Example: dynid torque --model identified.yaml --log exciting.csv --out torque.csv");
  command->callback([a, &status] {
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
