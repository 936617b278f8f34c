// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/excite.hpp"

#include <filesystem>

#include "app/check.hpp"
#include "app/job.hpp"
#include "dynid/identification/base_parameters.hpp"
#include "dynid/identification/least_squares.hpp"

namespace dynid {

void check_options(const ExciteJob& job) {
  const ExciteOptions& o = job.options;
  detail::check_within("harmonics", o.harmonics, 1, 50);
  detail::check_positive("period", o.duration);
  detail::check_not_negative("base_period", o.base_period);
  detail::check_positive("rate", job.rate);
  detail::check_positive("ramp", o.ramp);
  detail::check_within("margin", o.margin, 0.0, 0.49);
  detail::check_positive("starts", o.starts);
  detail::check_within("effort", o.effort, 10, 1000000);
  detail::check_not_negative("threads", o.threads);
}

ExciteReport run(const ExciteJob& job, const Context& context) {
  check_options(job);
  const detail::Stopwatch watch;
  detail::JobProgress progress(context);
  ExciteOptions options = job.options;
  options.progress = [&progress](double fraction) { progress("searching for a motion", fraction); };
  ExciteReport report;
  report.robot = job.robot;
  report.collision = job.collision.source;
  report.found = excite(job.robot, job.collision, options);
  context.check();
  if (job.compare) {
    const BaseParameters base = base_parameters(job.robot, options.regressor.rotor_inertia);
    report.compared = job.compare->source;
    report.compared_condition_number =
        condition_number(excitation_factor(job.robot, base, *job.compare, options.regressor));
  }
  if (report.found.feasible) report.motion = report.found.motion.sampled(job.rate);
  report.seconds = watch.seconds();
  context.check();
  return report;
}

CollisionModel collision_model(const std::string& choice, const std::string& robot_file, const Robot& robot) {
  if (choice == "none") return {};
  if (!choice.empty()) return read_collision(choice, robot);
  const std::filesystem::path file(robot_file);
  const std::filesystem::path beside = file.parent_path() / (file.stem().string() + "_collision.yaml");
  return std::filesystem::exists(beside) ? read_collision(beside.string(), robot) : CollisionModel{};
}

}  // namespace dynid
