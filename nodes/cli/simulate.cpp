// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/trajectory.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  RobotOption model;
  LogOption log;
  std::string trajectory, labels, out;
  bool excite = false, clean = false, list = false;
  std::vector<std::string> effects;
  unsigned long seed = 1;
  double noise = -1.0, rate = 1000.0, duration = 0.0, spread = 0.0;
};

/// A single number stands alone, as people write it.
nlohmann::json label(const Effect& effect) {
  nlohmann::json parameters = nlohmann::json::object();
  for (const EffectParameter& p : effect_schema(effect.name).parameters) {
    if (effect.parameters.count(p.key) == 0) continue;  // of another form
    const std::vector<double>& values = effect.parameters.at(p.key);
    if (p.per_joint || values.size() > 1) {
      parameters[p.key] = values;
    } else {
      parameters[p.key] = values.front();
    }
  }
  return {{"name", effect.name}, {"joints", effect.joints}, {"parameters", parameters}};
}

std::string in_a_list(const std::vector<double>& values) {
  std::string text;
  for (const double x : values) {
    char number[32];
    std::snprintf(number, sizeof number, "%g", x);
    text += (text.empty() ? "" : ":") + std::string(number);
  }
  return text;
}

/// `--effects`.
void list_effects(const Output& output) {
  nlohmann::json result = nlohmann::json::array();
  for (const EffectSchema& spec : effect_schemas()) {
    nlohmann::json parameters = nlohmann::json::array();
    for (const EffectParameter& p : spec.parameters) {
      parameters.push_back({{"key", p.key},
                            {"unit", p.unit},
                            {"text", p.text},
                            {"per_joint", p.per_joint},
                            {"size", p.initial.size()},
                            {"default", p.initial},
                            {"required", p.required()},
                            {"form", p.form}});
      for (const EffectDraw& draw : effect_draws(spec.name))
        if (draw.key == p.key) {
          parameters.back()["drawn_from"] = draw.low;
          parameters.back()["drawn_to"] = draw.high;
        }
    }
    result.push_back({{"name", spec.name},
                      {"text", spec.text},
                      {"scope", to_string(spec.scope)},
                      {"parameters", parameters}});
  }
  output.write({{"effects", result}});
  if (!output.summary()) return;
  std::cout << "Torque added on the measured side; * one value for each joint.\n";
  for (const EffectSchema& spec : effect_schemas()) {
    std::cout << "\n" << spec.name << ": " << spec.text << "\n";
    for (const EffectParameter& p : spec.parameters) {
      char line[160];
      std::snprintf(line, sizeof line, "  %-22s%-2s%-12s%-16s", p.key.c_str(), p.per_joint ? "*" : "",
                    p.unit == "1" ? "-" : p.unit.c_str(), in_a_list(p.initial).c_str());
      std::cout << line << p.text << "\n";
    }
  }
}

void run(const Arguments& a) {
  if (a.list) {
    a.output.check();
    list_effects(a.output);
    return;
  }
  if (a.model.path.empty()) throw Error("simulate: --model is required");
  if (a.out.empty()) throw Error("simulate: --out is required");
  if (a.excite == !a.trajectory.empty())
    throw Error("simulate: one of --trajectory and --excite is required");
  if (a.duration > 0.0 && !a.excite) throw Error("simulate: --duration goes with --excite");
  if (is_bag(a.trajectory)) throw Error(a.trajectory + ": a motion to follow is a CSV file, not a bag");
  a.output.check({a.out, a.labels});
  const Robot robot = a.model.read(a.output).robot;
  std::vector<Effect> effects;
  for (const std::string& text : a.effects) {
    try {
      effects.push_back(parse_effect(text, robot));
    } catch (const Error& error) {
      throw Error("--effect " + text + ": " + error.what());
    }
  }
  const Stopwatch watch;
  Progress progress(a.output);
  progress("simulating");
  const Trajectory motion = a.excite ? random_motion(robot, a.duration > 0.0 ? a.duration : 20.0, a.seed)
                                     : read_trajectory(a.trajectory, robot.size());
  SimulateOptions options;
  const double noise = a.noise >= 0.0 ? a.noise : (a.clean ? 0.0 : 1.0);
  options.measurement = MeasurementOptions::realistic(noise);
  if (a.clean) {
    const MeasurementOptions noisy = options.measurement;
    options.measurement = MeasurementOptions::clean();
    options.measurement.white_noise = noisy.white_noise;
    options.measurement.correlated_noise = noisy.correlated_noise;
    options.record_acceleration = true;
  }
  options.seed = a.seed;
  options.spread = a.spread;
  options.rate = a.rate;
  const SimulatedRun simulated = simulate(robot, effects, motion, options);
  const double seconds = watch.seconds();

  nlohmann::json labels = nlohmann::json::array(), added = nlohmann::json::array();
  std::vector<Eigen::VectorXd> rms;
  for (std::size_t k = 0; k < simulated.truth.effects.size(); ++k) {
    labels.push_back(label(simulated.truth.effects[k]));
    rms.emplace_back(
        (simulated.injected[k].colwise().squaredNorm() / double(simulated.t.size())).cwiseSqrt().transpose());
    added.push_back(to_json(rms.back()));
  }
  Eigen::VectorXd astray = Eigen::VectorXd::Zero(robot.size()), q(robot.size()), dq(q), ddq(q);
  for (Eigen::Index i = 0; i < simulated.t.size(); ++i) {
    sample(motion, motion.t[0] + simulated.t[i], q, dq, ddq);
    astray = astray.cwiseMax((q - simulated.seen_q.row(i).transpose()).cwiseAbs());
  }
  a.log.write(a.out, simulated.log, robot);
  if (!a.labels.empty()) write_file(a.labels, labels.dump(2) + "\n");

  a.output.write({{"samples", simulated.log.samples()},
                  {"rate_hz", a.rate},
                  {"duration", simulated.t[simulated.t.size() - 1]},
                  {"seed", a.seed},
                  {"noise", noise},
                  {"spread", a.spread},
                  {"effects", labels},
                  {"effect_torque_rms", added},
                  {"tracking_error_max", to_json(astray)},
                  {"out", a.out},
                  {"seconds", seconds}});
  if (!a.output.summary()) return;
  std::cout << simulated.log.samples() << " samples of " << robot.name << " along " << motion.source
            << " written to " << a.out << "\n  largest tracking error [rad]  " << in_a_row(astray, 3) << "\n";
  for (std::size_t k = 0; k < rms.size(); ++k)
    std::cout << "  " << simulated.truth.effects[k].name << ", rms [N m]  " << in_a_row(rms[k], 3) << "\n";
}

}  // namespace

void add_simulate(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("simulate", "A closed-loop run of a robot that has chosen effects");
  a->model.add_to(*command, "--model", false);
  a->model.allow_inconsistent = true;
  command->add_option("--trajectory", a->trajectory, "Motion to follow (CSV: t, q1.., dq1.., ddq1..)")
      ->type_name("FILE");
  command->add_flag("--excite", a->excite, "Follow a random smooth motion of that seed within the limits");
  command->add_option("--duration", a->duration, "Of that motion [s] (20)")->check(CLI::PositiveNumber);
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
  command->add_option("--seed", a->seed, "Of everything random")->capture_default_str();
  command->add_option("--noise", a->noise, "Times the torque noise of a good robot (1; with --clean 0)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--rate", a->rate, "Of the log [Hz]; divides 1000")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--spread", a->spread, "Of the true parameters around the model's, 0.02: 2 %")
      ->check(CLI::Range(0.0, 0.49))
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
    run(*a);
    status = 0;
  });
}

}  // namespace dynid
