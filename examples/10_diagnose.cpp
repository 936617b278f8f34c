// SPDX-License-Identifier: Apache-2.0
//
// A diagnosis without files: logs that are in memory already, the answer as a struct. Usage: 10_diagnose
// MODEL.
#include <cstdio>
#include <dynid/app/report.hpp>
#include <dynid/effect/parse.hpp>
#include <dynid/model/robot_file.hpp>
#include <dynid/simulation/random_motion.hpp>
#include <dynid/simulation/simulate.hpp>

/// t, q, dq and tau from wherever they are: rows are samples, columns joints, base to tip.
dynid::Log from_memory(const dynid::Log& recorder) {
  dynid::Log log;
  log.source = "recorder";
  log.t = recorder.t;      // [s]
  log.q = recorder.q;      // [rad]
  log.dq = recorder.dq;    // [rad/s]
  log.tau = recorder.tau;  // [N m], gravity included
  return log;
}

int main(int argc, char** argv) try {
  if (argc != 2) throw dynid::Error("usage: 10_diagnose MODEL");
  const dynid::Robot nominal = dynid::read_robot(argv[1]);

  // In place of a robot: joint 4 rubs more than the model says.
  const dynid::Effect hidden = dynid::parse_effect("coulomb_friction:joints=4,coefficient=1.2", nominal);
  std::vector<dynid::Log> logs;
  for (const unsigned long seed : {5UL, 6UL}) {
    dynid::SimulateOptions options;
    options.measurement = dynid::MeasurementOptions::realistic();
    options.rate = 250.0;
    options.seed = seed;
    logs.push_back(from_memory(
        dynid::simulate(nominal, {hidden}, dynid::random_motion(nominal, 12.0, seed), options).log));
  }

  dynid::DiagnoseOptions options;
  options.progress = [](const std::string& stage, double fraction) {
    if (fraction == 0.0) std::printf("  %s\n", stage.c_str());
  };
  const dynid::Diagnosis d = dynid::diagnose(nominal, logs, options);
  std::printf("%s\n", dynid::verdict_sentence(d).c_str());
  for (const dynid::Judgement& j : d.judgement) std::printf("  %s\n", j.text.c_str());
  for (const dynid::FoundEffect& e : d.effects)
    for (const dynid::ParameterEstimate& p : e.parameters)
      if (p.per_joint)
        std::printf("  %s of joint 4: %.3f [%.3f, %.3f] %s\n", p.key.c_str(), p.value[3], p.low[3], p.high[3],
                    p.unit.c_str());
  const dynid::Robot better = dynid::patched(nominal, d.effects);  // the model with what was found
  std::printf("Coulomb friction of joint 4: %.3f N m before, %.3f N m in the patched model\n",
              nominal.joints[3].friction.linear.coulomb, better.joints[3].friction.linear.coulomb);
  return d.verdict == dynid::Verdict::explained && !d.effects.empty() ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
