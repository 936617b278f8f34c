// SPDX-License-Identifier: Apache-2.0
#include "cli/identify_servo.hpp"

#include <cmath>
#include <iomanip>
#include <iostream>
#include <optional>

#include "dynid/base/error.hpp"
#include "dynid/identification/servo.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

nlohmann::json bound(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(); }

nlohmann::json servo_json(const ServoFit& fit) {
  nlohmann::json parameters = nlohmann::json::object(), aliases = nlohmann::json::array(),
                 terms = nlohmann::json::array();
  for (const ServoValue& v : fit.values)
    parameters[v.name] = {
        {"value", v.value}, {"low", bound(v.low)}, {"high", bound(v.high)}, {"unit", v.unit}};
  for (const ServoAlias& a : fit.aliases)
    aliases.push_back({{"names", {a.first, a.second}}, {"correlation", a.correlation}});
  for (const ServoTerm& t : fit.terms)
    terms.push_back({{"name", t.name}, {"without", t.without}, {"with", t.with}, {"kept", t.kept}});
  return {{"joint", fit.joint},    {"name", fit.name},         {"identified", fit.identified},
          {"si", fit.si},          {"parameters", parameters}, {"aliases", aliases},
          {"terms", terms},        {"error", fit.error},       {"held_out", fit.held_out},
          {"remarks", fit.remarks}};
}

void print(const ServoFit& fit) {
  std::cout << "joint " << fit.joint << " (" << fit.name << ")";
  if (!fit.identified) {
    std::cout << ": " << fit.remarks.front() << "\n";
    return;
  }
  std::cout << ": mean absolute error " << 1e3 * fit.error << " mrad fitted, " << 1e3 * fit.held_out
            << " mrad left out" << (fit.si ? "" : "; ratios only") << "\n";
  for (const ServoValue& v : fit.values) {
    std::cout << "  " << std::left << std::setw(24) << v.name << std::right << std::setw(12) << v.value
              << " [" << v.low << ", " << v.high << "]";
    if (v.unit != "1") std::cout << " " << v.unit;
    std::cout << "\n";
  }
  for (const ServoTerm& t : fit.terms)
    if (t.kept)
      std::cout << "  " << t.name << " kept: " << 1e3 * t.without << " to " << 1e3 * t.with
                << " mrad left out\n";
  for (const ServoAlias& a : fit.aliases) {
    std::cout << "  not told apart: " << a.first << ", " << a.second;
    if (a.correlation != 0.0) std::cout << " (correlation " << a.correlation << ")";
    std::cout << "\n";
  }
  for (const std::string& remark : fit.remarks) std::cout << "  " << remark << "\n";
}

}  // namespace

void identify_servo(const Output& output, const RobotOption& robot, const LogOption& input,
                    const std::vector<std::string>& paths, const std::string& out) {
  const Stopwatch watch;
  output.check({out});
  std::optional<Robot> body;
  if (!robot.path.empty()) body = robot.read(output).robot;
  LogColumns required;
  required.dq = required.tau = false;
  Progress progress(output);
  std::vector<Log> logs;
  for (const std::string& path : paths) {
    progress("reading " + path);
    logs.push_back(input.read(path, body ? *body : Robot(), required));
  }
  ServoOptions options;
  options.progress = [&progress](const std::string& stage, double fraction) { progress(stage, fraction); };
  const ServoIdentification id = identify_servos(logs, body, options);
  if (!out.empty()) {
    std::string note = "servos identified from";
    for (const std::string& path : paths) note += " " + path;
    write_model(out, {id.robot, {}, note});
  }
  nlohmann::json joints = nlohmann::json::array(), issues = nlohmann::json::array();
  Eigen::VectorXd error(static_cast<Eigen::Index>(id.joints.size())), held_out = error;
  for (std::size_t j = 0; j < id.joints.size(); ++j) {
    joints.push_back(servo_json(id.joints[j]));
    error[static_cast<Eigen::Index>(j)] = id.joints[j].error;
    held_out[static_cast<Eigen::Index>(j)] = id.joints[j].held_out;
  }
  for (const DataIssue& i : id.issues)
    issues.push_back(
        {{"name", i.name}, {"joints", i.joints}, {"value", i.value}, {"unit", i.unit}, {"text", i.text}});
  output.write({{"joints", joints},
                {"error", to_json(error)},
                {"held_out", to_json(held_out)},
                {"confidence", options.confidence},
                {"data", {{"issues", issues}}},
                {"seconds", watch.seconds()}});
  if (!output.summary()) return;
  std::cout << "Servos of " << id.robot.name << " from " << logs.size()
            << (logs.size() == 1 ? " log" : " logs") << "; intervals at " << 100.0 * options.confidence
            << " %\n"
            << std::setprecision(4);
  for (const ServoFit& fit : id.joints) print(fit);
  for (const DataIssue& issue : id.issues) std::cout << issue.text << "\n";
  if (!out.empty()) std::cout << "Model written to " << out << "\n";
}

}  // namespace dynid
