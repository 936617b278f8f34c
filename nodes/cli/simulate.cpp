// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/simulate.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/simulate_servos.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/effect/catalogue.hpp"
#include "dynid/effect/servo_effects.hpp"

namespace dynid {
namespace {

struct SimulateArguments {
  Output output;
  RobotOption model;
  LogOption log;
  std::string trajectory, labels, out;
  bool excite = false, clean = false, list = false, servo = false, torque = false;
  std::vector<std::string> effects;
  unsigned long seed = 1;
  std::optional<double> noise, duration, rate;
  double spread = 0.0;
};

/// `--effects`.
void list_effects(const Output& output, bool servo) {
  output.check();
  const std::vector<EffectSchema>& effects = servo ? servo_effect_schemas() : effect_schemas();
  output.write(to_json(effects));
  if (output.summary()) print(std::cout, effects);
}

void check(const SimulateArguments& a) {
  if (a.model.path.empty()) throw Error("simulate: --model is required");
  if (a.out.empty()) throw Error("simulate: --out is required");
  if (a.excite == !a.trajectory.empty())
    throw Error("simulate: one of --trajectory and --excite is required");
  if (a.duration && !a.excite) throw Error("simulate: --duration goes with --excite");
  if (is_bag(a.trajectory)) throw Error(a.trajectory + ": a motion to follow is a CSV file, not a bag");
  a.output.check({a.out, a.labels});
}

/// The log, its labels, JSON and summary.
template <class Report>
void write(const SimulateArguments& a, const Robot& robot, const Report& report) {
  a.log.write(a.out, report.run.log, robot);
  if (!a.labels.empty()) write_file(a.labels, labels_json(report).dump(2) + "\n");
  nlohmann::json result = to_json(report);
  result["out"] = a.out;
  a.output.write(result);
  if (a.output.summary()) print(std::cout, report, a.out);
}

/// `--servo`.
void run_servos(const SimulateArguments& a) {
  SimulateServosJob job;
  job.seed = a.seed;
  job.noise = a.noise;
  job.clean = a.clean;
  job.spread = a.spread;
  job.torque = a.torque;
  if (a.rate) job.rate = *a.rate;
  if (a.duration) job.duration = *a.duration;
  check_options(job);
  check(a);
  job.robot = a.model.read(a.output).robot;
  job.effects = parse_servo_effects(a.effects, job.robot);
  if (!a.trajectory.empty()) job.commands = read_trajectory(a.trajectory, job.robot.size());
  Progress progress(a.output);
  const SimulateServosReport report = run(job, progress.context());
  write(a, job.robot, report);
}

void run_simulate(const SimulateArguments& a) {
  if (a.list) return list_effects(a.output, a.servo);
  if (a.servo) return run_servos(a);
  SimulateJob job;
  job.seed = a.seed;
  job.noise = a.noise;
  job.clean = a.clean;
  if (a.rate) job.rate = *a.rate;
  job.spread = a.spread;
  if (a.duration) job.duration = *a.duration;
  check_options(job);
  check(a);
  if (a.torque) throw Error("simulate: --torque goes with --servo: other logs have it anyhow");
  job.robot = a.model.read(a.output).robot;
  job.effects = parse_effects(a.effects, job.robot);
  if (!a.trajectory.empty()) job.motion = read_trajectory(a.trajectory, job.robot.size());
  Progress progress(a.output);
  const SimulateReport report = run(job, progress.context());

  write(a, job.robot, report);
}

}  // namespace

void add_simulate(CLI::App& app, int& status) {
  auto a = std::make_shared<SimulateArguments>();
  CLI::App* command = app.add_subcommand("simulate", "A closed-loop run of a robot that has chosen effects");
  a->model.add_to(*command, "--model", false);
  a->model.allow_inconsistent = true;
  command->add_option("--trajectory", a->trajectory, "Motion to follow (CSV: t, q1.., dq1.., ddq1..)")
      ->type_name("FILE");
  command->add_flag("--excite", a->excite, "Follow a random smooth motion of that seed within the limits");
  command->add_option("--duration", a->duration, "Of that motion [s] (20)");
  command
      ->add_option(
          "--effect", a->effects,
          "NAME[:key=value,...], again for another; joints=1+3+5 names joints; values over joints: one "
          "for all, or one for each as 0.5:0.2:0.4; vectors alike: com=0:0:0.1")
      ->type_name("EFFECT")
      ->expected(1)
      ->allow_extra_args(false)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_flag("--effects", a->list, "List the effects with their parameters, units and defaults");
  command->add_flag(
      "--servo", a->servo,
      "The joints' position servos follow the motion as commands, held from row to row; the log "
      "has t, u1.., q1.., dq1..; --effects lists those of servos");
  command->add_flag("--torque", a->torque, "With --servo: the log has tau1.. too");
  command->add_option("--seed", a->seed, "Of everything random")->capture_default_str();
  command->add_option("--noise", a->noise, "Times the torque noise of a good robot (1; with --clean 0)");
  command->add_option("--rate", a->rate, "Of the log [Hz]; divides 1000 (1000; with --servo any, 100)");
  command->add_option("--spread", a->spread, "Of the true parameters around the model's, 0.02: 2 %")
      ->capture_default_str();
  command->add_flag("--clean", a->clean,
                    "Perfect encoders, velocities, stamps and packets; the log has ddq and, without --noise, "
                    "no noise");
  command
      ->add_option("--labels", a->labels,
                   "JSON to write: the effects, as a list of {name, joints, parameters}")
      ->type_name("FILE");
  command->add_option("--out", a->out, "Log to write (CSV: t, q1.., dq1.., tau1..; or .bag)")
      ->type_name("FILE");
  a->log.add_to(*command, true);
  a->output.add_to(*command);
  command->footer(
      "Example: dynid simulate --model config/panda.yaml --excite --effect payload:mass=2,com=0:0:0.1 "
      "--effect coulomb_friction:joints=2+4,coefficient=0.8:0.5 --out log.csv");
  command->callback([a, &status] {
    run_simulate(*a);
    status = 0;
  });
}

}  // namespace dynid
