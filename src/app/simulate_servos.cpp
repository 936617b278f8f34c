// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/simulate_servos.hpp"

#include <nlohmann/json.hpp>
#include <ostream>

#include "app/check.hpp"
#include "app/job.hpp"
#include "app/serialise.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/app/text.hpp"
#include "dynid/base/error.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/effect/servo_effects.hpp"
#include "dynid/simulation/random_motion.hpp"

namespace dynid {
namespace {

/// A servo's commands follow each other slowly: lower harmonics than an exciting motion's.
Trajectory random_commands(const SimulateServosJob& job) {
  RandomMotionOptions options;
  options.rate = std::max(100.0, job.rate);
  options.base_frequency = 0.1;
  options.harmonics = 6;
  return random_motion(job.robot, job.duration, job.seed, options);
}

}  // namespace

std::vector<Effect> parse_servo_effects(const std::vector<std::string>& texts, const Robot& robot) {
  constexpr double sharp = 1e-4;  // of the joint's speed
  std::vector<Effect> effects;
  const std::vector<JointScale> scales = joint_scales(robot);
  for (const std::string& text : texts) {
    try {
      Effect effect = parse_servo_effect(text, robot);
      const auto width = effect.parameters.find("velocity_scale");
      if (width != effect.parameters.end() && text.find("velocity_scale") == std::string::npos)
        for (const int j : effect.joints)
          if (width->second.size() == scales.size())
            width->second[static_cast<std::size_t>(j - 1)] =
                sharp * scales[static_cast<std::size_t>(j - 1)].speed;
      effects.push_back(effect);
    } catch (const Error& error) {
      throw OptionError("effect", text + ": " + error.what());
    }
  }
  return effects;
}

void check_options(const SimulateServosJob& job) {
  detail::check_positive("duration", job.duration);
  detail::check_positive("rate", job.rate);
  if (job.noise) detail::check_not_negative("noise", *job.noise);
  detail::check_within("spread", job.spread, 0.0, 0.49);
}

SimulateServosReport run(const SimulateServosJob& job, const Context& context) {
  check_options(job);
  const detail::Stopwatch watch;
  context.report("simulating", 0.0);
  const Trajectory commands = job.commands ? *job.commands : random_commands(job);
  SimulateServosOptions options;
  options.rate = job.rate;
  options.seed = job.seed;
  options.spread = job.spread;
  options.record_torque = job.torque;
  if (job.clean) options.encoder_step = options.noise = 0.0;
  if (job.noise) options.noise *= *job.noise;
  SimulateServosReport report;
  report.robot = job.robot.name;
  report.commands = commands.source;
  report.seed = job.seed;
  report.noise = job.clean ? 0.0 : job.noise.value_or(1.0);
  report.rate = job.rate;
  report.spread = job.spread;
  report.run = simulate_servos(job.robot, job.effects, commands, options);
  report.tracking_error = (report.run.log.u - report.run.log.q).cwiseAbs().colwise().mean().transpose();
  report.seconds = watch.seconds();
  context.check();
  return report;
}

nlohmann::json labels_json(const SimulateServosReport& report) {
  nlohmann::json labels = nlohmann::json::array();
  for (const Effect& e : report.run.hidden)
    labels.push_back({{"name", e.name}, {"joints", e.joints}, {"parameters", e.parameters}});
  return labels;
}

nlohmann::json to_json(const SimulateServosReport& report) {
  const Log& log = report.run.log;
  return {{"samples", log.samples()},
          {"rate_hz", report.rate},
          {"duration", log.t[log.t.size() - 1]},
          {"seed", report.seed},
          {"noise", report.noise},
          {"spread", report.spread},
          {"effects", labels_json(report)},
          {"tracking_error_mean", to_json(report.tracking_error)},
          {"seconds", report.seconds}};
}

void print(std::ostream& out, const SimulateServosReport& report, const std::string& written_to) {
  out << report.run.log.samples() << " samples of the servos of " << report.robot << " along "
      << report.commands << " written to " << written_to << "\n  mean |u - q| [rad or m]  "
      << in_a_row(report.tracking_error, 3) << "\n";
  for (const Effect& e : report.run.hidden) {
    out << "  " << e.name << " on joints";
    for (const int j : e.joints) out << " " << j;
    out << "\n";
  }
}

}  // namespace dynid
