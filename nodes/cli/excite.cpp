// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/excite.hpp"

#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

struct ExciteArguments {
  Output output;
  RobotOption robot;
  ExciteOptions options;
  std::vector<double> weights;
  bool no_friction = false;
  double rate = 1000.0;
  std::string collision, compare, out, joint_trajectory;
};

void write_motion(const ExciteArguments& a, const ExciteReport& report) {
  write_trajectory(a.out, report.motion);
  if (a.joint_trajectory.empty()) return;
  std::vector<std::string> names;
  for (const Joint& joint : report.robot.joints) names.push_back(joint.name);
  write_file(a.joint_trajectory, to_joint_trajectory(report.motion, names));
}

int run_excite(const ExciteArguments& a) {
  ExciteJob job;
  job.options = a.options;
  job.options.regressor.friction = !a.no_friction;
  job.options.regressor.weights =
      Eigen::Map<const Eigen::VectorXd>(a.weights.data(), static_cast<Eigen::Index>(a.weights.size()));
  job.rate = a.rate;
  check_options(job);
  a.output.check({a.out, a.joint_trajectory});
  Progress progress(a.output);
  job.robot = a.robot.read(a.output).robot;
  job.collision = collision_model(a.collision, a.robot.path, job.robot);
  if (!a.compare.empty()) job.compare = read_trajectory(a.compare, job.robot.size());
  const ExciteReport report = run(job, progress.context());

  nlohmann::json result = to_json(report);
  if (report.succeeded()) {
    write_motion(a, report);
    result["out"] = a.out;
  }
  a.output.write(result);
  if (!report.succeeded()) {
    std::cerr << "dynid: no motion found within the limits; the nearest breaks "
              << in_words(report.found.margins[static_cast<std::size_t>(report.found.limiting)]) << "\n";
    return 1;
  }
  if (a.output.summary()) print(std::cout, report, a.out);
  return 0;
}

}  // namespace

void add_excite(CLI::App& app, int& status) {
  auto a = std::make_shared<ExciteArguments>();
  ExciteOptions& o = a->options;
  CLI::App* command = app.add_subcommand("excite", "A motion worth recording: optimised within every limit");
  a->robot.add_to(*command);
  command->add_option("--out", a->out, "Trajectory to write (CSV: t, q1.., dq1.., ddq1..)")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--joint-trajectory", a->joint_trajectory,
                   "Also write it as a trajectory_msgs/JointTrajectory (YAML, for rostopic pub -f)")
      ->type_name("FILE");
  command->add_option("--harmonics", o.harmonics, "Harmonics of the finite Fourier series, 1 to 50")
      ->capture_default_str();
  command->add_option("--period", o.duration, "How long the motion takes, from rest to rest [s]")
      ->capture_default_str();
  command->add_option("--base-period", o.base_period,
                      "Period of the series' first harmonic [s]; optimised when not given, or 0");
  command->add_option("--rate", a->rate, "Samples a second")->capture_default_str();
  command
      ->add_option(
          "--kind", o.kind,
          "The series alone, at rest at its ends, or any series with a smooth polynomial start and end, "
          "exactly periodic in between")
      ->transform(CLI::CheckedTransformer(motion_kinds(), CLI::ignore_case))
      ->type_name("fourier|ramped");
  command->add_option("--ramp", o.ramp, "Length of the start and of the end of --kind ramped [s]")
      ->capture_default_str();
  command
      ->add_option("--criterion", o.criterion,
                   "Smallest condition number of the regressor, or largest determinant of its information")
      ->transform(CLI::CheckedTransformer(excitation_criteria(), CLI::ignore_case))
      ->type_name("condition|determinant");
  command->add_option("--weights", a->weights, "Weight of each joint's rows [1/(N m)], base to tip")
      ->delimiter(',')
      ->type_name("W1,W2,...");
  command->add_flag("--no-friction", a->no_friction, "Leave the friction columns of eq. (24) out");
  command->add_flag("--rotor-inertia", o.regressor.rotor_inertia,
                    "Reflected rotor inertias are identified too");
  command
      ->add_option(
          "--collision", a->collision,
          "Capsules, floor and boxes (dynid-collision-1), or none; by default NAME_collision.yaml beside "
          "the robot NAME.yaml, where there is one")
      ->type_name("FILE|none");
  command->add_option("--margin", o.margin, "Share of every limit to be left free, 0 to 0.49")
      ->capture_default_str();
  command->add_option("--compare", a->compare, "Another motion (CSV) to compute the condition number of")
      ->type_name("FILE");
  command->add_option("--seed", o.seed, "Seed of the starts")->capture_default_str();
  command->add_option("--starts", o.starts, "Motions drawn; the best quarter is refined")
      ->capture_default_str();
  command->add_option("--effort", o.effort, "Evaluations of the criterion a start, at least 10")
      ->capture_default_str();
  command->add_option("--threads", o.threads, "0: all cores; the result does not depend on it")
      ->capture_default_str();
  a->output.add_to(*command);
  command->footer("Example: dynid excite --robot config/panda.yaml --out trajectory.csv");
  command->callback([a, &status] { status = run_excite(*a); });
}

}  // namespace dynid
