// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/diagnose.hpp"

#include <nlohmann/json.hpp>

#include "app/check.hpp"
#include "app/job.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/diagnosis/report.hpp"
#include "dynid/identification/identify.hpp"

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

/// A word of a command line, for a shell.
std::string quoted(const std::string& word) {
  if (!word.empty() && word.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                              "_-./=:,+@%") == std::string::npos)
    return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

std::string in_json(double value) { return nlohmann::json(value).dump(); }

}  // namespace

void check_options(const DiagnoseJob& job) {
  detail::check_not_negative("cutoff", job.options.cutoff);
  detail::check_not_negative("tolerance", job.options.tolerance);
  for (const std::string& name : job.withhold)
    if (name != "friction" && name != "payload" && find_hypothesis(name) == nullptr)
      throw OptionError("withhold", name + " is not friction, payload or the name of an effect");
}

DiagnoseReport run(const DiagnoseJob& job, const Context& context) {
  check_options(job);
  context.check();
  DiagnoseReport report;
  report.nominal = job.nominal;
  report.referenced = job.reference.has_value();
  for (const Log& log : job.logs) report.logs.push_back(log.source);
  DiagnoseOptions options = job.options;
  for (const std::string& name : job.withhold)
    if (!take_out(name, report.nominal)) options.withhold.push_back(name);
  const double start = job.reference ? 0.3 : 0.0;
  if (job.reference) {
    const Context healthy = context.part(0.0, start);
    detail::JobProgress progress(healthy, 0.6);
    IdentifyOptions identify_options;
    identify_options.validate = false;
    identify_options.progress = [&progress](const std::string& stage, double fraction) {
      progress("healthy log: " + stage, fraction);
    };
    report.nominal = identify(report.nominal, {*job.reference}, {}, identify_options).robot;
  }
  const Context search = context.part(start, 1.0);
  detail::JobProgress progress(search);
  options.progress = std::ref(progress);
  report.diagnosis = diagnose(report.nominal, job.logs, options);
  context.check();
  return report;
}

std::optional<ModelFile> DiagnoseReport::patch() const {
  if (diagnosis.effects.empty()) return std::nullopt;
  return ModelFile{patched(nominal, diagnosis.effects), {}, "effects found by diagnosis of " + logs.front()};
}

std::string DiagnoseReport::html(const std::string& command, const std::string& version) const {
  return to_html(diagnosis, {nominal.name, logs, command, version, referenced});
}

std::string DiagnoseCommand::line() const {
  std::string out = "dynid diagnose --model " + quoted(model);
  const auto add = [&out](const std::string& option, const std::string& value) {
    if (!value.empty()) out += " " + option + " " + quoted(value);
  };
  const DiagnoseOptions usual;
  add("--base", base);
  add("--tip", tip);
  out += " --log";
  for (const std::string& log : logs) out += " " + quoted(log);
  add("--reference", reference);
  add("--topic", topic);
  for (const std::string& name : withhold) add("--withhold", name);
  if (cutoff > 0.0) add("--cutoff", in_json(cutoff));
  if (tolerance != usual.tolerance) add("--tolerance", in_json(tolerance));
  if (seed != usual.seed) add("--seed", std::to_string(seed));
  add("--patch", patch);
  add("--next-trajectory", next_trajectory);
  add("--report", report);
  return out;
}

}  // namespace dynid
