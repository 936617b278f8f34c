// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/blind.hpp"

#include <filesystem>
#include <iomanip>
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/diagnosis/calibration.hpp"

namespace dynid {
namespace {

const std::map<std::string, BlindKind> kinds = {{"clean", BlindKind::clean},
                                                {"nominal", BlindKind::nominal},
                                                {"weak", BlindKind::weak},
                                                {"vendor", BlindKind::vendor},
                                                {"mixed", BlindKind::mixed}};

struct Arguments {
  Output output;
  RobotOption model;
  BlindOptions options;
  std::string calibration;  // file to write
};

nlohmann::json case_json(const BlindCase& c) {
  nlohmann::json truth = nlohmann::json::array(), found = nlohmann::json::array();
  for (const Effect& e : c.truth)
    truth.push_back({{"name", e.name}, {"joints", e.joints}, {"parameters", e.parameters}});
  for (const FoundEffect& e : c.found) {
    nlohmann::json intervals = nlohmann::json::object();
    for (const Estimate& p : e.parameters)
      intervals[p.key] = {{"low", std::vector<double>(p.low.begin(), p.low.end())},
                          {"high", std::vector<double>(p.high.begin(), p.high.end())}};
    found.push_back({{"name", e.effect.name},
                     {"joints", e.effect.joints},
                     {"parameters", e.effect.parameters},
                     {"intervals", intervals},
                     {"probability", e.probability},
                     {"aliases", e.aliases}});
  }
  return {{"truth", truth},          {"withheld", c.withheld},       {"verdict", to_string(c.verdict)},
          {"found", found},          {"p_value", c.p_value},         {"explained", c.explained},
          {"shrink", c.shrink},      {"true_shrink", c.true_shrink}, {"nominal_error", c.nominal_error},
          {"seconds", c.seconds},    {"failure", c.failure},         {"drawn", c.drawn},
          {"shares", c.truth_shares}};
}

void run(const Arguments& a) {
  namespace fs = std::filesystem;
  a.output.check({a.calibration});
  Output silent = a.output;
  silent.quiet = true;
  BlindOptions options = a.options;
  const Robot nominal = a.model.read(silent).robot;
  const bool temporary = options.folder.empty();
  if (temporary) {
    std::string pattern = (fs::temp_directory_path() / "dynid-blind-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw Error(pattern + ": cannot be made");
    options.folder = pattern;
  }
  std::vector<BlindCase> cases;
  {
    Progress progress(a.output);
    options.progress = [&progress](int done, int of) {
      progress("case " + std::to_string(done) + " of " + std::to_string(of), double(done) / of);
    };
    cases = run_blind(nominal, options);
  }
  if (temporary) fs::remove_all(options.folder);
  const BlindScore s = score(cases);
  nlohmann::json result = {{"cases", s.cases},
                           {"failures", s.failures},
                           {"seed", options.seed},
                           {"no_gap", s.no_gap},
                           {"false_alarms", s.false_alarms},
                           {"known", s.known},
                           {"first_right", s.first_right},
                           {"class_right", s.class_right},
                           {"joints_right", s.joints_right},
                           {"unknown", s.unknown},
                           {"abstained", s.abstained},
                           {"pairs", s.pairs},
                           {"both_found", s.both_found},
                           {"confident_wrong", s.confident_wrong},
                           {"calibration_error", s.calibration_error},
                           {"intervals", s.intervals},
                           {"covered", s.covered},
                           {"parameter_error", s.parameter_error},
                           {"shrink", s.shrink},
                           {"shrink_of_true", s.shrink_of_true},
                           {"confusion", s.confusion}};
  for (const auto& [key, value] : further_figures(s)) result[key] = value;
  result["list"] = nlohmann::json::array();
  for (const BlindCase& c : cases) result["list"].push_back(case_json(c));
  if (!a.calibration.empty()) {
    std::string kind;
    for (const auto& [name, value] : kinds)
      if (value == options.kind) kind = name;
    write_file(a.calibration,
               calibration_yaml(fit_calibration(cases),
                                "dynid blind --cases " + std::to_string(options.cases) + " --seed " +
                                    std::to_string(options.seed) + " --kind " + kind + " --calibrate FILE"));
  }
  a.output.write(result);
  if (!a.output.summary()) return;
  std::cout << s.cases << " cases, seed " << options.seed << "\n  no gap: " << s.false_alarms << " of "
            << s.no_gap << " given an effect\n  first effect right: " << s.first_right << " of " << s.known
            << " (" << s.class_right << " with its declared aliases)\n  both of a pair: " << s.both_found
            << " of " << s.pairs << "\n  unknown called unexplained: " << s.abstained << " of " << s.unknown
            << "\n  wrong at a probability of 0.9 or more: " << s.confident_wrong << "\n  calibration error "
            << s.calibration_error << ", intervals cover " << s.covered << " of " << s.intervals
            << "\n  median parameter error " << s.parameter_error << ", median shrink " << s.shrink << " ("
            << s.shrink_of_true << " of what the true effects give)\n";
  for (const auto& [truth, named] : s.confusion) {
    std::cout << "  " << std::setw(34) << std::left << truth << std::right;
    for (const auto& [name, count] : named) std::cout << " " << name << " " << count << ";";
    std::cout << "\n";
  }
}

}  // namespace

void add_blind(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("blind", "Diagnose a bank of simulated robots whose effects are withheld");
  a->model.path = "config/panda.yaml";
  a->model.add_to(*command, "--model", false);
  command->add_option("--cases", a->options.cases, "Cases")->required()->check(CLI::PositiveNumber);
  command->add_option("--seed", a->options.seed, "Of the bank")->capture_default_str();
  command
      ->add_option(
          "--kind", a->options.kind,
          "clean; nominal: parameters off by 2 %, coloured noise, jitter; weak: effects at 0.3 x; vendor: no "
          "friction, no rotors, inertials off by 5 and 10 %; mixed: the first three in turn")
      ->transform(CLI::CheckedTransformer(kinds))
      ->type_name("KIND");
  command->add_flag("--family", a->options.family, "An arm, a motion and a rate of its own for each case");
  command->add_option("--folder", a->options.folder, "Keep the logs, and apart from them the labels, here")
      ->type_name("FOLDER");
  command
      ->add_option(
          "--calibrate", a->calibration,
          "Fit what makes probabilities and intervals mean what they say to this bank, and write it (YAML; "
          "config/diagnosis_calibration.yaml is built in)")
      ->type_name("FILE");
  a->output.add_to(*command);
  command->footer("Example: dynid blind --cases 200 --seed 7 --kind nominal --json blind.json");
  command->callback([a, &status] {
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
