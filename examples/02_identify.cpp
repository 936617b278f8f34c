// SPDX-License-Identifier: Apache-2.0
//
// Dynamic coefficients from motion. Usage: 02_identify MODEL [LOG.csv]. Without a log, one is made of the
// model, with a robot's electronics; of the model only the kinematics are then used.
#include <cstdio>
#include <dynid/identification/identify.hpp>
#include <dynid/model/robot_file.hpp>
#include <dynid/simulation/random_motion.hpp>
#include <dynid/simulation/simulate.hpp>

int main(int argc, char** argv) try {
  if (argc < 2) throw dynid::Error("usage: 02_identify MODEL [LOG.csv]");
  dynid::Robot robot = dynid::read_robot(argv[1]);
  dynid::Log log;
  if (argc > 2) {
    log = dynid::read_log(argv[2], robot.size());
  } else {
    dynid::SimulateOptions options;
    options.measurement = dynid::MeasurementOptions::realistic();
    options.rate = 250.0;  // [Hz]
    log = dynid::simulate(robot, {}, dynid::random_motion(robot, 20.0, 1), options).log;
    log.source = "made";
  }
  robot.set_parameters(Eigen::VectorXd::Zero(10 * robot.size()));  // forgotten

  dynid::IdentifyOptions options;
  options.friction = dynid::FrictionLaw::linear;  // eq. (24)
  const dynid::Identification found = dynid::identify(robot, {log}, {}, options);

  std::printf("%d coefficients, condition number %.1f, relative error %.2f %%\n", found.rank,
              found.condition_number, found.fit.relative_error_percent);
  for (const dynid::DataIssue& issue : found.logs[0].report.issues)
    std::printf("  %s: %s\n", issue.name.c_str(), issue.text.c_str());
  for (const dynid::Coefficient& c : found.coefficients)
    if (c.kept && c.std_percent < 3.0)
      std::printf("  %-5s %9.4f +- %.1f %%  %s\n", c.name.c_str(), c.value, c.std_percent,
                  c.expression.c_str());
  // Held out: blocks of the log that a second fit never saw.
  for (int j = 0; j < robot.size(); ++j)
    std::printf("joint %d: %.3f N m\n", j + 1, found.validation->rmse[j]);
  return found.fit.relative_error_percent < 5.0 ? 0 : 1;
} catch (const dynid::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
