// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/excite.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <map>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/identification/least_squares.hpp"
#include "dynid/signal/trajectory.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption robot;
  ExciteOptions options;
  std::vector<double> weights;
  bool no_friction = false;
  double rate = 1000.0;
  std::string collision, compare, out, joint_trajectory;
};

/// `panda.yaml` has its shape in `panda_collision.yaml` beside it, where no other is named.
std::string collision_file(const Arguments& a) {
  if (!a.collision.empty()) return a.collision == "none" ? "" : a.collision;
  const std::filesystem::path robot(a.robot.path);
  const std::filesystem::path beside = robot.parent_path() / (robot.stem().string() + "_collision.yaml");
  return std::filesystem::exists(beside) ? beside.string() : "";
}

nlohmann::json margins_json(const std::vector<LimitMargin>& margins) {
  nlohmann::json list = nlohmann::json::array();
  for (const LimitMargin& m : margins) {
    nlohmann::json one = {{"name", m.name}, {"margin", m.margin}, {"unit", m.unit}, {"share", m.share}};
    if (m.joint > 0) one["joint"] = m.joint;
    if (!m.between.empty()) one["between"] = m.between;
    list.push_back(one);
  }
  return list;
}

std::string in_words(const LimitMargin& m) {
  char value[64];
  std::snprintf(value, sizeof value, "%.3g %s (%.1f %%)", m.margin, m.unit.c_str(), 100.0 * m.share);
  std::string text = m.name;
  if (m.joint > 0) text += " of joint " + std::to_string(m.joint);
  if (m.between.size() == 2) text += " of " + m.between[0] + " and " + m.between[1];
  return text + ": " + value;
}

int run(const Arguments& a) {
  a.output.check({a.out, a.joint_trajectory});
  const Stopwatch watch;
  Progress progress(a.output);
  const Robot robot = a.robot.read(a.output).robot;
  const std::string shape_file = collision_file(a);
  const CollisionModel collision = shape_file.empty() ? CollisionModel{} : read_collision(shape_file, robot);
  ExciteOptions options = a.options;
  options.regressor.friction = !a.no_friction;
  options.regressor.weights =
      Eigen::Map<const Eigen::VectorXd>(a.weights.data(), static_cast<Eigen::Index>(a.weights.size()));
  options.progress = [&](double fraction) { progress("searching for a motion", fraction); };
  Trajectory other;
  if (!a.compare.empty()) other = read_trajectory(a.compare, robot.size());
  const Excitation found = excite(robot, collision, options);

  nlohmann::json runs = nlohmann::json::array();
  for (const ExciteRun& r : found.runs)
    runs.push_back({{"start", r.start},
                    {"base_period", r.base_period},
                    {"criterion", r.criterion},
                    {"feasible", r.feasible},
                    {"evaluations", r.evaluations}});
  const MotionShape& shape = found.motion.shape();
  const int L = shape.harmonics;
  nlohmann::json coefficients = {{"a", nlohmann::json::array()}, {"b", nlohmann::json::array()}};
  for (int l = 0; l < L; ++l) {
    coefficients["a"].push_back(to_json(Eigen::VectorXd(found.motion.coefficients().row(l))));
    coefficients["b"].push_back(to_json(Eigen::VectorXd(found.motion.coefficients().row(L + l))));
  }
  coefficients["q0"] = to_json(found.motion.offset());
  nlohmann::json result = {{"feasible", found.feasible},
                           {"columns", found.columns},
                           {"condition_number", found.condition_number},
                           {"log_determinant", found.log_determinant},
                           {"duration", shape.duration},
                           {"base_period", 2.0 * M_PI / shape.omega},
                           {"omega", shape.omega},
                           {"harmonics", L},
                           {"coefficients", coefficients},
                           {"collision", shape_file.empty() ? nlohmann::json() : nlohmann::json(shape_file)},
                           {"margins", margins_json(found.margins)},
                           {"runs", runs}};
  if (found.limiting >= 0)
    result["limiting"] = margins_json({found.margins[static_cast<std::size_t>(found.limiting)]})[0];
  double compared = 0.0;
  if (!a.compare.empty()) {
    const BaseParameters base = base_parameters(robot, options.regressor.rotor_inertia);
    compared = condition_number(excitation_factor(robot, base, other, options.regressor));
    result["compare"] = {{"source", a.compare}, {"condition_number", compared}};
  }
  result["seconds"] = watch.seconds();
  if (found.feasible) {
    Trajectory motion = found.motion.sampled(a.rate);
    write_trajectory(a.out, motion);
    result["out"] = a.out;
    result["samples"] = motion.samples();
    if (!a.joint_trajectory.empty()) {
      std::vector<std::string> names;
      for (const Joint& joint : robot.joints) names.push_back(joint.name);
      write_file(a.joint_trajectory, to_joint_trajectory(motion, names));
    }
  }
  a.output.write(result);
  if (!found.feasible)
    std::cerr << "dynid: no motion found within the limits; the nearest breaks "
              << in_words(found.margins[static_cast<std::size_t>(found.limiting)]) << "\n";
  if (!found.feasible || !a.output.summary()) return found.feasible ? 0 : 1;
  std::cout << "Exciting motion of " << robot.name << ": " << shape.duration << " s, " << L
            << " harmonics, base period " << 2.0 * M_PI / shape.omega << " s, written to " << a.out << "\n"
            << "  condition number " << found.condition_number << " (" << found.columns << " columns)";
  if (compared > 0.0) std::cout << ", that of " << a.compare << " " << compared;
  std::cout << "\n  "
            << (shape_file.empty() ? "collisions are not checked: no --collision file"
                                   : "clear of collisions by " + shape_file)
            << "\n  margins, least share of the limit first:\n";
  std::vector<LimitMargin> margins = found.margins;
  std::stable_sort(margins.begin(), margins.end(),
                   [](const LimitMargin& x, const LimitMargin& y) { return x.share < y.share; });
  for (std::size_t k = 0; k < std::min<std::size_t>(8, margins.size()); ++k)
    std::cout << "    " << in_words(margins[k]) << "\n";
  return 0;
}

}  // namespace

void add_excite(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
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
  command->add_option("--harmonics", o.harmonics, "Harmonics of the finite Fourier series")
      ->capture_default_str()
      ->check(CLI::Range(1, 50));
  command->add_option("--period", o.duration, "How long the motion takes, from rest to rest [s]")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--base-period", o.base_period,
                   "Period of the series' first harmonic [s]; optimised when not given")
      ->check(CLI::PositiveNumber);
  command->add_option("--rate", a->rate, "Samples a second")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  const std::map<std::string, MotionKind> kinds = {{"fourier", MotionKind::fourier},
                                                   {"ramped", MotionKind::ramped}};
  command
      ->add_option(
          "--kind", o.kind,
          "The series alone, at rest at its ends, or any series with a smooth polynomial start and end, "
          "exactly periodic in between")
      ->transform(CLI::CheckedTransformer(kinds, CLI::ignore_case))
      ->type_name("fourier|ramped");
  command->add_option("--ramp", o.ramp, "Length of the start and of the end of --kind ramped [s]")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  const std::map<std::string, ExcitationCriterion> criteria = {
      {"condition", ExcitationCriterion::condition}, {"determinant", ExcitationCriterion::determinant}};
  command
      ->add_option("--criterion", o.criterion,
                   "Smallest condition number of the regressor, or largest determinant of its information")
      ->transform(CLI::CheckedTransformer(criteria, CLI::ignore_case))
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
  command->add_option("--margin", o.margin, "Share of every limit to be left free")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 0.49));
  command->add_option("--compare", a->compare, "Another motion (CSV) to compute the condition number of")
      ->type_name("FILE");
  command->add_option("--seed", o.seed, "Seed of the starts")->capture_default_str();
  command->add_option("--starts", o.starts, "Motions drawn; the best quarter is refined")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->add_option("--effort", o.effort, "Evaluations of the criterion a start")
      ->capture_default_str()
      ->check(CLI::Range(10, 1000000));
  command->add_option("--threads", o.threads, "0: all cores; the result does not depend on it")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  a->output.add_to(*command);
  command->footer("Example: dynid excite --robot config/panda.yaml --out trajectory.csv");
  command->callback([a, &status] { status = run(*a); });
}

}  // namespace dynid
