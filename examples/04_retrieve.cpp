// SPDX-License-Identifier: Apache-2.0
//
// Section V of the letter: masses, centres of mass and inertias that bodies can have, from coefficients, with
// a constraint that is an if-else. Usage: 04_retrieve MODEL; its bounds are read from MODEL's folder.
#include <cstdio>
#include <dynid/identification/base_parameters.hpp>
#include <dynid/model/robot_file.hpp>
#include <dynid/retrieval/retrieval.hpp>
#include <string>

int main(int argc, char** argv) try {
  if (argc != 2) throw dynid::Error("usage: 04_retrieve MODEL");
  const std::string path = argv[1];
  const dynid::Robot robot = dynid::read_robot(path);

  // What an identification would have given: the coefficients, and no single mass.
  const dynid::BaseParameters base = dynid::base_parameters(robot);
  dynid::RetrievalProblem problem;
  problem.objective = dynid::Objective::two_step(base.K, base.K * robot.parameters());
  problem.bounds = dynid::read_bounds(path.substr(0, path.rfind('.')) + "_bounds.yaml");

  // A heavy link 3 leaves link 4 light, or else link 4 is the heavy one: as a text, h >= 0 ...
  problem.bounds.constraints.push_back(
      dynid::make_expression("elbow", "m3 > 3.5 ? 3.5 - m4 : m4 - 3.5", robot.size()));
  // ... and in C++: only where link 7 weighs more than 0.5 kg, its centre of mass is near the flange's axis.
  constexpr int m7 = 60, c7x = 61, c7y = 62;  // ten parameters a link: m, c_x, c_y, c_z, I_xx, ...
  dynid::Inequality heavy, near;
  heavy.value = [](const Eigen::VectorXd& p) { return p[m7] - 0.5; };
  near.value = [](const Eigen::VectorXd& p) { return 4e-4 - p[c7x] * p[c7x] - p[c7y] * p[c7y]; };
  problem.bounds.constraints.push_back(
      dynid::make_conditional("hand", heavy, dynid::make_constraint("near the axis", near), {}));

  dynid::RetrievalOptions options;
  options.runs = 3;
  options.steps = 4;
  const dynid::RetrievalResult best = dynid::retrieve(problem, options);
  std::printf("%s: objective %.3e, %.2f kg in all\n", best.feasible ? "feasible" : "not feasible",
              best.objective, best.total_mass);
  for (std::size_t k = 0; k < best.links.size(); ++k)
    std::printf("  link %zu: %.3f kg, com %7.4f %7.4f %7.4f m\n", k + 1, best.links[k].mass,
                best.links[k].com.x(), best.links[k].com.y(), best.links[k].com.z());
  for (const dynid::ConstraintMargin& c : best.constraints)
    if (c.name == "elbow" || c.name == "hand") std::printf("  %s: margin %.4f\n", c.name.c_str(), c.margin);
  return best.feasible ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
