// SPDX-License-Identifier: Apache-2.0
#include "ros/identification_run.hpp"

#include <filesystem>
#include <iostream>

#include "app/serialise.hpp"
#include "dynid/app/servo.hpp"
#include "dynid/app/text.hpp"
#include "dynid/app/uncertainty.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/number.hpp"
#include "dynid/model/model_warning.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/model/yaml.hpp"
#include "ros/bag.hpp"
#include "ros/reading_watch.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

Robot read_nominal(const IdentificationSettings& s, bool tell) {
  std::vector<Inconsistency> broken;
  Robot robot = read_robot(s.model, s.base, s.tip,
                           s.allow_inconsistent ? Consistency::warn : Consistency::refuse, &broken);
  if (tell)
    for (const Inconsistency& rule : broken)
      std::cerr << "identification_node: warning: " << s.model << ": link '" << rule.link << "' (joint "
                << rule.joint << "): " << rule.rule << ", margin " << rule.margin << "\n";
  if (s.gravity) robot.gravity = *s.gravity;
  if (tell)
    for (const ModelWarning& warning : check_model(robot))
      std::cerr << "identification_node: warning: " << s.model << ": " << warning.text << "\n";
  return robot;
}

/// A bag, or CSV; with commands and without torques where servos are identified.
Log read_any_log(const IdentificationSettings& s, const std::string& path, const Robot& robot,
                 const Context& context) {
  const LogColumns required = s.command_topic.empty() ? LogColumns() : servo_columns();
  context.report("reading " + path, 0.0);
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  if (fs::path(path).extension() != ".bag") {
    LogOptions options;
    options.joints = robot.size();
    options.joint_names = names;
    if (!s.columns.empty()) options.columns = parse_columns(s.columns);
    options.rate = s.log_rate;
    options.required = required;
    return read_log(path, options);
  }
  std::string warning;
  Log log = s.command_topic.empty()
                ? read_bag(path, names, s.topic, required, &warning)
                : read_servo_bag(path, names, s.topic, s.command_topic, required, &warning);
  if (!warning.empty()) std::cerr << "identification_node: warning: " << warning << "\n";
  return log;
}

void write_json(const std::string& path, const nlohmann::json& value) {
  write_file(path, value.dump(2) + "\n");
}

/// The settings' job with what their files hold.
PipelineJob job_of(const IdentificationSettings& s, const std::string& log, const Context& context,
                   bool tell) {
  PipelineJob job = s.job;
  job.robot = read_nominal(s, tell);
  job.source = s.model;
  job.log = read_any_log(s, log, job.robot, context);
  if (!s.validation.empty()) job.identify.validation = {read_any_log(s, s.validation, job.robot, context)};
  if (job.retrieve) {
    job.retrieve->bounds = read_bounds(s.bounds);
    if (!s.prior.empty()) job.retrieve->prior = read_robot(s.prior, s.base, s.tip);
  }
  if (job.diagnose && !s.reference.empty())
    job.diagnose->reference = read_any_log(s, s.reference, job.robot, context);
  return job;
}

/// The line of the program that makes the same diagnosis.
std::string diagnose_line(const IdentificationSettings& s, const std::string& log, const std::string& patch,
                          const std::string& report) {
  DiagnoseCommand command;
  command.model = s.model;
  command.base = s.base;
  command.tip = s.tip;
  command.logs = {log};
  command.reference = s.reference;
  if (s.topic != IdentificationSettings().topic) command.topic = s.topic;
  command.assume = s.job.diagnose->assume;
  if (s.gravity)
    command.gravity = exact_number(s.gravity->x()) + "," + exact_number(s.gravity->y()) + "," +
                      exact_number(s.gravity->z());
  command.columns = s.columns;
  command.rate = s.log_rate;
  command.withhold = s.job.diagnose->withhold;
  command.tolerance = s.job.diagnose->options.tolerance;
  command.seed = s.job.diagnose->options.seed;
  command.patch = patch;
  command.report = report;
  return command.line();
}

/// The servos alone: nothing in it is for an estimator of torques to adopt.
nlohmann::json identify_servo_log(const IdentificationSettings& s, const std::string& log,
                                  const Context& context, std::ostream* summary) {
  const std::string model = file_in_folder(s, "identified.yaml"),
                    json = file_in_folder(s, "identification.json");
  IdentifyServosJob job;
  job.robot = read_nominal(s, summary != nullptr);
  job.logs = {read_any_log(s, log, *job.robot, context)};
  const IdentifyServosReport report = run(job, context);
  const nlohmann::json identification = to_json(report);
  write_model(model, report.model());
  write_json(json, identification);
  if (summary != nullptr) {
    print(*summary, report);
    *summary << "Model written to " << model << "\n";
  }
  nlohmann::json result = {{"log", log},      {"retrieval", nullptr}, {"diagnosis", nullptr},
                           {"adoptable", ""}, {"misread", ""},        {"identification", identification},
                           {"status", 0}};
  result["files"] = {{"model", model}, {"identification", json}};
  write_json(file_in_folder(s, "result.json"), result);
  return result;
}

}  // namespace

std::string file_in_folder(const IdentificationSettings& settings, const std::string& name) {
  return (fs::path(settings.folder) / name).string();
}

void make_folder(const IdentificationSettings& settings) {
  std::error_code error;
  fs::create_directories(settings.folder, error);
  if (error) throw Error(settings.folder + ": cannot be made: " + error.message());
  check_writable(file_in_folder(settings, "result.json"));
}

Trajectory find_motion(const IdentificationSettings& settings, const Context& context) {
  make_folder(settings);
  ExciteJob job = settings.excite;
  job.robot = read_nominal(settings, false);
  job.collision = collision_model(settings.collision, settings.model, job.robot);
  const ExciteReport report = run(job, context);
  if (!report.succeeded()) throw Error("no exciting motion was found within the limits");
  Trajectory motion = report.motion;
  motion.source = file_in_folder(settings, "trajectory.csv");
  write_trajectory(motion.source, motion);
  return motion;
}

nlohmann::json identify_log(const IdentificationSettings& settings, const std::string& log,
                            const Context& context, std::ostream* summary) {
  if (!fs::exists(log)) throw Error(log + ": there is no such file");
  const auto path = [&](const char* name) { return file_in_folder(settings, name); };
  make_folder(settings);
  if (!settings.command_topic.empty()) return identify_servo_log(settings, log, context, summary);
  nlohmann::json result = {{"log", log}, {"retrieval", nullptr}, {"diagnosis", nullptr}};
  nlohmann::json& files = result["files"];
  PipelineJob job = job_of(settings, log, context, summary != nullptr);

  LearntUncertainty learnt;
  job.identified = [&](const IdentifyReport& report) {
    files["model"] = result["adoptable"] = path("identified.yaml");
    files["identification"] = path("identification.json");
    result["identification"] = to_json(report);
    IdentifyJob fitted = job.identify;
    fitted.robot = job.robot, fitted.logs = {job.log};
    learnt = uncertainty_of(fitted, report, {nullptr, context.stop});
    write_model(path("identified.yaml"), report.model(), learnt.uncertainty);
    write_json(path("identification.json"), result["identification"]);
    if (summary == nullptr) return;
    print(*summary, report);
    *summary << "Model written to " << path("identified.yaml") << "\n";
  };
  if (job.retrieve) job.retrieve->source = path("identified.yaml");
  job.retrieved = [&](const RetrieveReport& report) {
    files["retrieval"] = path("retrieval.json");
    result["retrieval"] = to_json(report);
    if (report.succeeded()) {
      result["adoptable"] = files["feasible"] = path("feasible.yaml");
      write_model(path("feasible.yaml"), report.model(), learnt.uncertainty);  // the same coefficients
    }
    write_json(path("retrieval.json"), result["retrieval"]);
    if (summary == nullptr) return;
    print(*summary, report);
    if (report.succeeded()) *summary << "Model written to " << path("feasible.yaml") << "\n";
  };
  job.diagnosed = [&](const DiagnoseReport& report) {
    files["diagnosis"] = path("diagnosis.json");
    files["report"] = path("report.html");
    result["diagnosis"] = to_json(report);
    if (const auto patch = report.patch()) {
      files["patched"] = path("patched.yaml");
      write_model(path("patched.yaml"), *patch);  // its only log fitted it: none shows how far it strays
    }
    write_file(
        path("report.html"),
        report.html(diagnose_line(settings, log, path("patched.yaml"), path("report.html")), DYNID_VERSION));
    write_json(path("diagnosis.json"), result["diagnosis"]);
    if (summary != nullptr) print(*summary, report);
  };
  const PipelineReport report = run(job, context);
  const ConventionReport& read =
      report.diagnose ? report.diagnose->diagnosis.conventions : report.identify.conventions;
  const std::string misread = job.identify.assume.empty() ? misread_text(read) : "";
  result["misread"] = misread;
  if (!misread.empty()) result["adoptable"] = "";
  result["status"] = report.succeeded() ? 0 : 1;
  write_json(path("result.json"), result);
  return result;
}

}  // namespace dynid
