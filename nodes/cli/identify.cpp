// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/identify.hpp"

#include <iostream>
#include <map>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "cli/identify_servo.hpp"
#include "dynid/base/error.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption robot;
  LogOption input;
  std::vector<std::string> logs, validation;
  std::string out;
  double cutoff = 0.0;
  FrictionLaw friction = FrictionLaw::linear;
  bool rotor_inertia = false;
  Method method = Method::ols;
  MotionSource motion = MotionSource::automatic;
  double prune = 30.0;
  bool friction_only = false;
  bool servo = false;
};

const char* law_name(FrictionLaw law) {
  return law == FrictionLaw::none ? "none" : law == FrictionLaw::linear ? "linear" : "sigmoid";
}

nlohmann::json quality_json(const FitQuality& q) {
  return {{"source", q.source},
          {"rows", q.rows},
          {"rmse", to_json(q.rmse)},
          {"relative_error_percent", q.relative_error_percent}};
}

nlohmann::json comparison_json(const std::vector<FrictionComparison>& comparison) {
  nlohmann::json list = nlohmann::json::array();
  for (const FrictionComparison& c : comparison)
    list.push_back({{"joint", c.joint},
                    {"held_out_rms", {{"linear", c.linear}, {"sigmoid", c.sigmoid}}},
                    {"law", law_name(c.chosen)}});
  return list;
}

std::vector<Log> read_logs(const LogOption& input, const std::vector<std::string>& paths, const Robot& robot,
                           Progress& progress) {
  std::vector<Log> logs;
  for (const std::string& path : paths) {
    progress("reading " + path);
    logs.push_back(input.read(path, robot));
  }
  return logs;
}

IdentifyOptions options_of(const Arguments& a, Progress& progress) {
  IdentifyOptions options;
  options.prepare.cutoff = a.cutoff;
  options.prepare.source = a.motion;
  options.friction = a.friction;
  options.rotor_inertia = a.rotor_inertia;
  options.method = a.method;
  options.prune_percent = a.prune;
  options.progress = [&progress](const std::string& stage, double fraction) { progress(stage, fraction); };
  return options;
}

void run_friction_only(const Arguments& a, const Robot& robot) {
  const Stopwatch watch;
  Progress progress(a.output);
  const TwoStageFriction result = identify_friction(robot, read_logs(a.input, a.logs, robot, progress),
                                                    a.friction, options_of(a, progress));
  if (!a.out.empty())
    write_model(a.out, {result.robot, {}, std::string("friction identified on top of ") + a.robot.path});
  nlohmann::json friction = nlohmann::json::array();
  for (const Joint& joint : result.robot.joints) {
    const JointFriction& f = joint.friction;
    friction.push_back({{"viscous", f.linear.viscous},
                        {"coulomb", f.linear.coulomb},
                        {"offset", f.linear.offset},
                        {"phi1", f.sigmoid.phi1},
                        {"phi2", f.sigmoid.phi2},
                        {"phi3", f.sigmoid.phi3}});
  }
  a.output.write({{"friction", friction},
                  {"before", quality_json(result.before)},
                  {"rmse", to_json(result.after.rmse)},
                  {"relative_error_percent", result.after.relative_error_percent},
                  {"friction_laws", comparison_json(result.comparison)},
                  {"seconds", watch.seconds()}});
  if (!a.output.summary()) return;
  std::cout << "Friction on top of " << a.robot.path << " (Section IV-B), " << law_name(a.friction)
            << " law\n"
            << "  rms before [N m]: " << in_a_row(result.before.rmse) << "\n"
            << "  rms after  [N m]: " << in_a_row(result.after.rmse) << "\n";
  if (!a.out.empty()) std::cout << "Model written to " << a.out << "\n";
}

void run(const Arguments& a) {
  if (a.servo) return identify_servo(a.output, a.robot, a.input, a.logs, a.out);
  if (a.robot.path.empty()) throw Error("--robot is required (it is optional with --servo only)");
  const Stopwatch watch;
  a.output.check({a.out});
  const Robot robot = a.robot.read(a.output).robot;
  if (a.friction_only) return run_friction_only(a, robot);
  Progress progress(a.output);
  const Identification id =
      identify(robot, read_logs(a.input, a.logs, robot, progress),
               read_logs(a.input, a.validation, robot, progress), options_of(a, progress));
  if (!a.out.empty()) {
    std::string note = "identified from";
    for (const std::string& log : a.logs) note += " " + log;
    write_model(a.out, {id.robot, id.coefficients, note});
  }
  const bool consistent = inconsistencies(id.robot).empty();

  nlohmann::json result = {{"rank", id.rank},
                           {"condition_number", id.condition_number},
                           {"relative_error_percent", id.fit.relative_error_percent},
                           {"rmse", to_json(id.fit.rmse)},
                           {"cutoff_hz", id.cutoff},
                           {"noise", to_json(id.noise)},
                           {"correlation", to_json(id.correlation)},
                           {"physically_consistent", consistent},
                           {"coefficients", to_json(id.coefficients)},
                           {"data", to_json(id.logs)},
                           {"seconds", watch.seconds()}};
  if (id.validation) {
    result["validation"] = quality_json(*id.validation);
  } else {
    result["validation"] = {
        {"source", id.validation_note}, {"rmse", nullptr}, {"relative_error_percent", nullptr}};
  }
  if (!id.friction.empty()) result["friction_laws"] = comparison_json(id.friction);
  a.output.write(result);
  if (!a.output.summary()) return;

  std::cout << "Identified " << id.rank << " coefficients of " << robot.name << " from " << id.fit.rows
            << " rows a joint, low-passed at " << id.cutoff << " Hz\n"
            << "  condition number " << id.condition_number << ", relative error "
            << id.fit.relative_error_percent << " %\n"
            << "  rms [N m]            " << in_a_row(id.fit.rmse) << "\n";
  if (id.validation)
    std::cout << "  rms held out [N m]   " << in_a_row(id.validation->rmse) << "  (" << id.validation->source
              << ")\n";
  else
    std::cout << "  " << id.validation_note << "\n";
  for (const PreparedLog& log : id.logs)
    for (const DataIssue& issue : log.report.issues) {
      std::cout << "  " << log.source << ": " << issue.name << ": " << issue.text;
      if (!issue.joints.empty() && static_cast<int>(issue.joints.size()) < robot.size()) {
        std::cout << " (joints";
        for (int joint : issue.joints) std::cout << " " << joint;
        std::cout << ")";
      }
      std::cout << "\n";
    }
  for (const FrictionComparison& c : id.friction)
    std::cout << "  joint " << c.joint << ": " << law_name(c.chosen) << " friction (held-out rms " << c.linear
              << " linear, " << c.sigmoid << " sigmoid)\n";
  print(std::cout, id.coefficients);
  std::cout << "The standard parameters nearest " << a.robot.path << " that have these coefficients are "
            << (consistent ? "physically consistent.\n" : "not physically consistent: see dynid retrieve.\n");
  if (!a.out.empty()) std::cout << "Model written to " << a.out << "\n";
}

}  // namespace

void add_identify(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("identify", "Dynamic coefficients and friction from recorded motions");
  a->robot.add_to(*command, "--robot", false);
  command->add_flag("--servo", a->servo,
                    "Position servos from commanded and measured positions (CSV: t, u1.., q1..)");
  command->add_option("--log", a->logs, "Logs to fit (CSV: t, q1.., dq1.., tau1..; or .bag)")
      ->required()
      ->type_name("FILE...");
  command->add_option("--validate", a->validation, "Logs to predict, never fitted")->type_name("FILE...");
  a->input.add_to(*command);
  command->add_option("--out", a->out, "Model to write (YAML)")->type_name("FILE");
  command
      ->add_option("--cutoff", a->cutoff,
                   "Cut-off of the zero-phase low-pass filter [Hz]; chosen when not given")
      ->check(CLI::PositiveNumber);
  const std::map<std::string, FrictionLaw> laws = {
      {"none", FrictionLaw::none}, {"linear", FrictionLaw::linear}, {"sigmoid", FrictionLaw::sigmoid}};
  command
      ->add_option("--friction", a->friction,
                   "Joint friction: eq. (24), eq. (25) where it predicts better, or none")
      ->transform(CLI::CheckedTransformer(laws, CLI::ignore_case))
      ->type_name("none|linear|sigmoid");
  command->add_flag("--rotor-inertia", a->rotor_inertia, "Identify reflected rotor inertias too");
  const std::map<std::string, Method> methods = {
      {"ols", Method::ols}, {"wls", Method::wls}, {"irls", Method::irls}};
  command
      ->add_option("--method", a->method,
                   "Least squares: ordinary, weighted by joint, iteratively reweighted")
      ->transform(CLI::CheckedTransformer(methods, CLI::ignore_case))
      ->type_name("ols|wls|irls");
  const std::map<std::string, MotionSource> sources = {{"auto", MotionSource::automatic},
                                                       {"velocity", MotionSource::velocity},
                                                       {"position", MotionSource::position}};
  command
      ->add_option("--motion", a->motion,
                   "What accelerations are differentiated from; by default the quieter one")
      ->transform(CLI::CheckedTransformer(sources, CLI::ignore_case))
      ->type_name("auto|velocity|position");
  command
      ->add_option("--prune", a->prune,
                   "Drop coefficients whose standard deviation exceeds this many percent; 0: none")
      ->check(CLI::NonNegativeNumber);
  command->add_flag(
      "--friction-only", a->friction_only,
      "Keep the robot's rigid-body parameters and fit friction to the differences (Section IV-B)");
  a->output.add_to(*command);
  command->footer(
      "Example: dynid identify --robot config/panda.yaml --log exciting.csv --out identified.yaml\n"
      "         dynid identify --servo --log chirp.csv multisine.csv --out servos.yaml");
  command->callback([a, &status] {
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
