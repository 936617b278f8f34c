// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/diagnose.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "app/check.hpp"
#include "app/job.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/app/report.hpp"
#include "dynid/app/servo_diagnosis.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/text.hpp"
#include "dynid/diagnosis/effect_prediction.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/diagnosis/servo_diagnose.hpp"
#include "dynid/effect/enter.hpp"
#include "dynid/identification/identify.hpp"
#include "dynid/identification/servo.hpp"
#include "dynid/model/model_warning.hpp"

namespace dynid {
namespace {

/// Takes `name` out of the nominal model; false where it is not a part of that.
bool take_out(const std::string& name, Robot& nominal) {
  if (name == "friction") {
    for (Joint& joint : nominal.joints) joint.friction = {};
  } else if (name == "payload") {
    nominal.joints.back().parameters.setZero();
  } else {
    return false;
  }
  return true;
}

/// What is odd about the model stands first among the issues: its placeholders come out as effects.
void add_model_warnings(const Robot& nominal, Diagnosis& diagnosis) {
  std::vector<DataIssue> issues;
  for (const ModelWarning& w : check_model(nominal))
    issues.push_back({w.name, w.joints, w.value, "1", w.text});
  std::vector<DataIssue>& all = diagnosis.logs.front().report.issues;
  all.insert(all.begin(), issues.begin(), issues.end());
}

/// From commands and positions alone.
void run_servos(const DiagnoseJob& job, const Context& context, DiagnoseReport& report) {
  if (!job.assume.empty())
    throw OptionError("assume", "logs of commands without torques are read as they are");
  DiagnoseServosOptions options;
  options.tolerance = job.options.tolerance;
  options.withhold = job.options.withhold;
  options.rollout = job.options.replay;
  for (const std::string& name : job.withhold)
    if (!take_out(name, report.nominal)) options.withhold.push_back(name);
  if (job.reference) report.nominal = identify_servos({*job.reference}, report.nominal).robot;
  detail::JobProgress progress(context);
  options.progress = std::ref(progress);
  report.diagnosis = diagnose_servos(report.nominal, job.logs, options);
  context.check();
}

std::string in_json(double value) { return nlohmann::json(value).dump(); }

}  // namespace

void check_options(const DiagnoseJob& job) {
  detail::check_not_negative("cutoff", job.options.cutoff);
  detail::check_not_negative("tolerance", job.options.tolerance);
  for (const std::string& name : job.withhold)
    if (name != "friction" && name != "payload" && find_hypothesis(name) == nullptr &&
        std::count(servo_effect_names().begin(), servo_effect_names().end(), name) == 0)
      throw OptionError("withhold", name + " is not friction, payload or the name of an effect");
}

LogColumns diagnosis_columns(const Robot& nominal) {
  LogColumns required;
  if (std::any_of(nominal.joints.begin(), nominal.joints.end(),
                  [](const Joint& joint) { return joint.servo.has_value(); }))
    required.dq = required.tau = false;
  return required;
}

bool is_servo_diagnosis(const Robot& nominal, const std::vector<Log>& logs) {
  const bool servos = !diagnosis_columns(nominal).tau;
  bool any = false;
  for (const Log& log : logs) {
    if (log.tau.size() > 0) continue;
    if (log.u.size() == 0)
      throw Error(log.source + ": columns tau1..tau" + std::to_string(nominal.size()) + " are missing" +
                  (servos ? ", and commands u1.. too: a diagnosis needs one of them" : ""));
    if (!servos)
      throw Error(log.source +
                  ": has commands and no torque, and the model has no servo: identify them first "
                  "(dynid identify --servo), or give a model with position actuators");
    any = true;
  }
  return any;
}

DiagnoseReport run(const DiagnoseJob& job, const Context& context) {
  check_options(job);
  context.check();
  DiagnoseReport report;
  report.nominal = job.nominal;
  report.referenced = job.reference.has_value();
  for (const Log& log : job.logs) report.logs.push_back(log.source);
  if (is_servo_diagnosis(job.nominal, job.logs)) {
    run_servos(job, context, report);
    return report;
  }
  DiagnoseOptions options = job.options;
  for (const std::string& name : job.withhold)
    if (!take_out(name, report.nominal)) options.withhold.push_back(name);
  std::vector<Log> assumed_logs;  // a log of hours is not to stand in memory twice where it is read as it is
  std::optional<Log> reference = job.reference;
  options.reading = job.assume.empty() ? Reading::ask : Reading::apply;
  if (!job.assume.empty() && job.assume != "auto") {
    const Assumptions assumed = detail::assumptions(job.assume, report.nominal.size());
    report.nominal = apply_conventions(assumed, report.nominal);
    for (const Log& log : job.logs) assumed_logs.push_back(apply_conventions(assumed, report.nominal, log));
    if (reference) reference = apply_conventions(assumed, report.nominal, *std::move(reference));
    options.reading = Reading::trust;
  }
  if (reference && options.reading != Reading::trust) {
    // Fitted to a misread log, the model would agree with others that are misread alike.
    const ConventionReport misread = find_conventions(report.nominal, {*reference});
    if (!misread.conventions.empty())
      throw Error(reference->source + ": " + misread.conventions.front().text + ": give --assume " +
                  misread.assume);
  }
  const double start = reference ? 0.3 : 0.0;
  if (reference) {
    const Context healthy = context.part(0.0, start);
    detail::JobProgress progress(healthy, 0.6);
    IdentifyOptions identify_options;
    identify_options.validate = false;
    identify_options.progress = [&progress](const std::string& stage, double fraction) {
      progress("healthy log: " + stage, fraction);
    };
    // The healthy robot has the effects that its model names: what is identified is the rest.
    report.nominal = with_effects_entered(report.nominal, Entering::everything);
    reference->tau -= predict_effects(report.nominal, *reference);
    report.nominal = identify(report.nominal, {*reference}, {}, identify_options).robot;
  }
  const Context search = context.part(start, 1.0);
  detail::JobProgress progress(search);
  options.progress = std::ref(progress);
  report.diagnosis = diagnose(report.nominal, assumed_logs.empty() ? job.logs : assumed_logs, options);
  add_model_warnings(job.nominal, report.diagnosis);
  context.check();
  return report;
}

std::optional<ModelFile> DiagnoseReport::patch() const {
  if (diagnosis.effects.empty()) return std::nullopt;
  if (of_motion(diagnosis))
    return ModelFile{
        patched_servos(nominal, diagnosis.effects), {}, "effects found by diagnosis of " + logs.front()};
  return ModelFile{patched(nominal, diagnosis.effects), {}, "effects found by diagnosis of " + logs.front()};
}

std::string DiagnoseReport::html(const std::string& command, const std::string& version) const {
  return to_html(diagnosis, {nominal.name, logs, command, version, referenced});
}

std::string DiagnoseCommand::line() const {
  std::string out = "dynid diagnose --model " + shell_quoted(model);
  const auto add = [&out](const std::string& option, const std::string& value) {
    if (!value.empty()) out += " " + option + " " + shell_quoted(value);
  };
  const DiagnoseOptions usual;
  add("--base", base);
  add("--tip", tip);
  out += " --log";
  for (const std::string& log : logs) out += " " + shell_quoted(log);
  add("--reference", reference);
  add("--topic", topic);
  for (const std::string& name : withhold) add("--withhold", name);
  if (!calibration.empty()) add("--calibration", calibration);
  add("--assume", assume);
  add("--gravity", gravity);
  add("--columns", columns);
  if (rate > 0.0) add("--rate", in_json(rate));
  if (cutoff > 0.0) add("--cutoff", in_json(cutoff));
  if (tolerance != usual.tolerance) add("--tolerance", in_json(tolerance));
  if (seed != usual.seed) add("--seed", std::to_string(seed));
  add("--patch", patch);
  add("--next-trajectory", next_trajectory);
  add("--report", report);
  return out;
}

}  // namespace dynid
