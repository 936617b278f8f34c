// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/diagnose.hpp"

#include <algorithm>
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/diagnosis/report.hpp"
#include "dynid/identification/identify.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption model;
  LogOption input;
  std::vector<std::string> logs, withhold;
  std::string reference, patch, report, next_trajectory;
  DiagnoseOptions options;
};

nlohmann::json values_json(const Eigen::VectorXd& x) {
  if (x.size() == 1) return x[0];
  return to_json(x);
}

nlohmann::json effect_json(const FoundEffect& found) {
  nlohmann::json parameters = nlohmann::json::object();
  for (const Estimate& p : found.parameters)
    parameters[p.key] = {{"value", values_json(p.value)},
                         {"low", values_json(p.low)},
                         {"high", values_json(p.high)},
                         {"unit", p.unit}};
  return {{"name", found.effect.name},        {"joints", found.effect.joints}, {"share", found.share},
          {"probability", found.probability}, {"aliases", found.aliases},      {"parameters", parameters}};
}

nlohmann::json diagnosis_json(const Diagnosis& d) {
  nlohmann::json where = nlohmann::json::array(), windows = nlohmann::json::array(),
                 effects = nlohmann::json::array(), ranking = nlohmann::json::array();
  for (const GapCell& c : d.where)
    where.push_back({{"joint", c.joint}, {"regime", c.regime}, {"share", c.share}, {"p_value", c.p_value}});
  for (const GapWindow& w : d.windows)
    windows.push_back({{"log", w.log}, {"t0", w.t0}, {"t1", w.t1}, {"joints", w.joints}});
  for (const FoundEffect& e : d.effects) effects.push_back(effect_json(e));
  for (const RankedEffect& r : d.ranking)
    ranking.push_back({{"name", r.name}, {"probability", r.probability}});
  nlohmann::json visible = nlohmann::json::array();
  for (const VisibleSize& v : d.smallest_visible)
    visible.push_back({{"name", v.name}, {"joint", v.joint}, {"torque_rms", v.torque_rms}});
  nlohmann::json separates = nlohmann::json::array();
  for (const auto& [a, b] : d.next.separates) separates.push_back({a, b});
  return {{"format", "dynid-diagnosis-1"},
          {"data", to_json(d.logs)},
          {"gap",
           {{"rms", to_json(d.rms)},
            {"floor", to_json(d.floor)},
            {"where", where},
            {"windows", windows},
            {"smallest_visible", visible}}},
          {"p_value", d.p_value},
          {"verdict", to_string(d.verdict)},
          {"effects", effects},
          {"ranking", ranking},
          {"shrink",
           {{"before", to_json(d.shrink.before)},
            {"after", to_json(d.shrink.after)},
            {"floor", to_json(d.shrink.floor)},
            {"fraction", d.shrink.fraction},
            {"low", d.shrink.low},
            {"high", d.shrink.high},
            {"held_out", d.shrink.held_out},
            {"rollout",
             {{"horizon_s", to_json(d.rollout.horizon)},
              {"before", to_json(d.rollout.before)},
              {"after", to_json(d.rollout.after)}}}}},
          {"next_experiment", {{"text", d.next.text}, {"separates", separates}, {"trajectory", nullptr}}},
          {"nominal_error", d.nominal_error},
          {"explained", d.explained},
          {"cutoff_hz", d.cutoff},
          {"seconds", d.seconds}};
}

void print(const Diagnosis& d) {
  std::cout << "Verdict: " << to_string(d.verdict) << " (p = " << d.p_value
            << ")\n  gap [N m rms]:   " << in_a_row(d.rms) << "\n  floor [N m rms]: " << in_a_row(d.floor)
            << "\n";
  for (const FoundEffect& e : d.effects) {
    std::cout << "  " << e.effect.name << " on joint" << (e.effect.joints.size() > 1 ? "s" : "");
    for (const int j : e.effect.joints) std::cout << " " << j;
    std::cout << ": probability " << e.probability << ", share " << e.share;
    for (std::size_t k = 0; k < e.aliases.size(); ++k)
      std::cout << (k == 0 ? "; not told from " : ", ") << e.aliases[k];
    std::cout << "\n";
    for (const Estimate& p : e.parameters) {
      const int digits = p.value.cwiseAbs().maxCoeff() < 1e5 ? 4 : 13;  // a stamp counts from 1970
      std::cout << "    " << p.key << " " << in_a_row(p.value, digits) << " [" << p.unit << "]\n";
    }
  }
  if (!d.effects.empty())
    std::cout << "  the gap shrinks by " << 100.0 * d.shrink.fraction << " % (" << 100.0 * d.shrink.low
              << " to " << 100.0 * d.shrink.high << " %) on data not used\n";
  if (!d.smallest_visible.empty()) {
    const auto least = std::max_element(
        d.smallest_visible.begin(), d.smallest_visible.end(),
        [](const VisibleSize& a, const VisibleSize& b) { return a.torque_rms < b.torque_rms; });
    std::cout << "  would have been named on any joint: " << least->name << " and simpler ones of "
              << least->torque_rms << " N m rms\n";
  }
  std::cout << "Next: " << d.next.text << "\n";
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

/// The command that makes this diagnosis again.
std::string command_line(const Arguments& a) {
  std::string out = "dynid diagnose --model " + quoted(a.model.path);
  const auto add = [&out](const std::string& option, const std::string& value) {
    if (!value.empty()) out += " " + option + " " + quoted(value);
  };
  const DiagnoseOptions usual;
  const auto number = [](double x) { return nlohmann::json(x).dump(); };
  add("--base", a.model.base);
  add("--tip", a.model.tip);
  out += " --log";
  for (const std::string& log : a.logs) out += " " + quoted(log);
  add("--reference", a.reference);
  if (a.input.topic != LogOption().topic) add("--topic", a.input.topic);
  for (const std::string& name : a.withhold) add("--withhold", name);
  if (a.options.cutoff > 0.0) add("--cutoff", number(a.options.cutoff));
  if (a.options.tolerance != usual.tolerance) add("--tolerance", number(a.options.tolerance));
  if (a.options.seed != usual.seed) add("--seed", std::to_string(a.options.seed));
  add("--patch", a.patch);
  add("--next-trajectory", a.next_trajectory);
  add("--report", a.report);
  return out;
}

/// Whether the data were fit to be diagnosed.
bool run(const Arguments& a) {
  a.output.check({a.patch, a.report, a.next_trajectory});
  Output silent = a.output;
  silent.quiet = true;
  Robot nominal = a.model.read(silent).robot;
  DiagnoseOptions options = a.options;
  for (const std::string& name : a.withhold) {
    if (name == "friction") {
      for (Joint& joint : nominal.joints) joint.friction = {};
    } else if (name == "payload") {
      nominal.joints.back().parameters.setZero();
    } else if (find_hypothesis(name) == nullptr) {
      throw Error("--withhold " + name + ": not friction, payload or the name of an effect");
    } else {
      options.withhold.push_back(name);
    }
  }
  Progress progress(a.output);
  if (!a.reference.empty()) {
    progress("healthy log");
    IdentifyOptions identify_options;
    identify_options.validate = false;
    nominal = identify(nominal, {a.input.read(a.reference, nominal)}, {}, identify_options).robot;
  }
  std::vector<Log> logs;
  for (const std::string& log : a.logs) logs.push_back(a.input.read(log, nominal));
  options.progress = [&progress](const std::string& stage, double fraction) { progress(stage, fraction); };
  const Diagnosis d = diagnose(nominal, logs, options);
  if (!a.patch.empty() && !d.effects.empty())
    write_model(a.patch,
                {patched(nominal, d.effects), {}, "effects found by diagnosis of " + a.logs.front()});
  nlohmann::json result = diagnosis_json(d);
  result["view"] = a.reference.empty() ? "A" : "B";
  if (!a.next_trajectory.empty() && d.next.motion.samples() > 0) {
    write_trajectory(a.next_trajectory, d.next.motion);
    result["next_experiment"]["trajectory"] = a.next_trajectory;
  }
  if (!a.report.empty())
    write_file(a.report,
               to_html(d, {nominal.name, a.logs, command_line(a), DYNID_VERSION, !a.reference.empty()}));
  a.output.write(result);
  if (a.output.summary()) print(d);
  return d.verdict != Verdict::data_invalid;
}

}  // namespace

void add_diagnose(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "diagnose", "Where a model and a robot disagree, which effect makes it, and how far it shrinks");
  a->model.add_to(*command, "--model");
  a->model.allow_inconsistent = true;
  command->add_option("--log", a->logs, "Logs of the robot (CSV); of several, the last only judges")
      ->required()
      ->type_name("FILE...");
  command->add_option("--reference", a->reference, "Log of the healthy robot: says how far the model is off")
      ->type_name("FILE");
  a->input.add_to(*command);
  command->add_option("--withhold", a->withhold,
                      "Take friction or payload out of the model, or an effect out of the library");
  command->add_option("--patch", a->patch, "Model to write, with the effects in it (YAML)")
      ->type_name("FILE");
  command
      ->add_option("--report", a->report,
                   "Page to write: what was found, in words, figures and plots (HTML, self-contained)")
      ->type_name("FILE");
  command
      ->add_option("--next-trajectory", a->next_trajectory,
                   "Motion to write that tells apart the effects that these logs cannot (CSV)")
      ->type_name("FILE");
  command->add_option("--cutoff", a->options.cutoff, "Band looked at [Hz]")->check(CLI::PositiveNumber);
  command
      ->add_option("--tolerance", a->options.tolerance,
                   "Relative error of the model's parameters that is no gap")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--seed", a->options.seed, "Of surrogates and intervals")->capture_default_str();
  a->output.add_to(*command);
  command->footer(
      "Example: dynid diagnose --model config/panda.yaml --log a.csv b.csv --patch patched.yaml "
      "--report report.html");
  command->callback([a, &status] { status = run(*a) ? 0 : 1; });
}

}  // namespace dynid
