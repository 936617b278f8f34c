// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/bounds.hpp"

#include <filesystem>
#include <iostream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

struct BoundsArguments {
  Output output;
  RobotOption robot;
  BoundsJob job;
  std::vector<double> total_mass;
  std::string out;
};

bool is_urdf(const std::string& path) { return fs::path(path).extension() == ".urdf"; }

/// The URDF as a file beside `out` names it: relative where it is below the same folder.
std::string named_from(const std::string& out, const std::string& urdf) {
  const fs::path folder = fs::absolute(out).parent_path(), file = fs::absolute(urdf);
  const fs::path relative = file.lexically_normal().lexically_relative(folder.lexically_normal());
  return relative.empty() || *relative.begin() == ".." ? file.lexically_normal().string() : relative.string();
}

void run_bounds(const BoundsArguments& a) {
  a.output.check({a.out});
  BoundsJob job = a.job;
  job.robot = a.robot.read(a.output).robot;
  job.source = a.robot.path;
  job.urdf = is_urdf(a.robot.path);
  job.base = a.robot.base;
  job.tip = a.robot.tip;
  if (job.urdf) job.named = named_from(a.out, a.robot.path);
  if (!a.total_mass.empty()) job.total_mass = Eigen::Map<const Eigen::Vector2d>(a.total_mass.data());
  const BoundsReport report = run(job);
  write_file(a.out, report.text);
  nlohmann::json result = to_json(report);
  result["out"] = a.out;
  a.output.write(result);
  if (!a.output.summary()) return;
  std::cout << "Bounds of " << report.robot << " written to " << a.out << ": " << report.lower.size() / 10
            << " links, " << report.with_mass << " with an inertial, " << report.with_geometry
            << " with collision geometry, " << report.total_mass[0] << " to " << report.total_mass[1]
            << " kg in all\n";
  for (const std::string& note : report.notes) std::cout << "  " << note << "\n";
}

}  // namespace

void add_bounds(CLI::App& app, int& status) {
  auto a = std::make_shared<BoundsArguments>();
  CLI::App* command = app.add_subcommand(
      "bounds", "Write bounds for retrieve from a robot's inertials, collision geometry and total mass");
  a->robot.add_to(*command);
  a->robot.allow_inconsistent = true;  // what is looked for need not be there yet
  command
      ->add_option("--total-mass", a->total_mass,
                   "Of the moving links [kg]; usually their sum within a tenth")
      ->delimiter(',')
      ->expected(2)
      ->type_name("LOW,HIGH");
  command
      ->add_option("--mass-factor", a->job.mass_factor,
                   "A link's mass is at most so many times more or less than the file says")
      ->capture_default_str();
  command
      ->add_option(
          "--com-margin", a->job.com_margin,
          "Without collision geometry: how far a centre of mass may be from where the file has it [m]")
      ->capture_default_str();
  command->add_option("--out", a->out, "Bounds to write (YAML)")->required()->type_name("FILE");
  a->output.add_to(*command);
  command->footer("Example: dynid bounds --robot arm.urdf --out bounds.yaml");
  command->callback([a, &status] {
    run_bounds(*a);
    status = 0;
  });
}

}  // namespace dynid
