// SPDX-License-Identifier: Apache-2.0
// The whole loop without a robot: a log of the published Panda, as a robot would record it, is made, written,
// identified and reported.
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <sstream>

#include "base/plot.hpp"
#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/identification/identify.hpp"
#include "dynid/identification/predict.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/signal/table.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid {
namespace {

struct Arguments {
  Output output;
  std::string robot = "config/panda.yaml", out = "demo";
  unsigned seed = 1;
};

// Supplementary Table II of Gaz et al. 2019: q_j(t) = sum_l a_lj / (l w) sin(l w t) - b_lj / (l w) cos(l w t)
// + q0_j.
constexpr int joints = 7, harmonics = 5;
constexpr double base_frequency = 0.15 * M_PI;  // [rad/s]
constexpr double a[harmonics][joints] = {{-0.2031, -0.0699, 0.3076, 0.1269, -0.2773, 0.2100, -0.2273},
                                         {0.1295, -0.5380, 0.5864, -0.0253, -0.0857, -0.1194, -0.5636},
                                         {-0.0090, -0.2015, -0.4813, -0.2405, 0.4810, -0.0950, -0.2099},
                                         {0.2319, -0.5535, -0.1228, 0.2178, 0.5311, -0.0964, 0.5725},
                                         {-0.7598, 0.2352, -0.5273, 0.6984, -0.1639, -0.0399, -0.3748}};
constexpr double b[harmonics][joints] = {{-0.1136, -0.2437, 0.3898, 0.0401, 0.5491, 0.0692, 0.2023},
                                         {0.6600, 0.1820, -0.0268, -0.1503, 0.1046, -0.6946, -0.2570},
                                         {-0.1858, -0.2390, 0.0179, 0.2359, 0.0407, -0.4442, -0.5010},
                                         {0.1867, -0.2647, 0.4767, -0.2022, -0.0432, -0.5749, 0.0774},
                                         {0.2357, 0.4252, 0.2726, 0.3693, 0.2448, -0.0698, -0.4833}};
constexpr double q0[joints] = {-0.5850, -0.1744, -0.3373, -1.8767, -1.0631, 1.7917, -0.7284};

/// 21 s of that motion by the simulated robot: the log that its electronics would give.
Log record(const Robot& robot, unsigned seed) {
  Trajectory motion;
  motion.source = "the letter's motion";
  motion.t = Eigen::VectorXd::LinSpaced(21001, 0.0, 21.0);
  motion.q = motion.dq = motion.ddq = Eigen::MatrixXd::Zero(motion.t.size(), joints);
  for (int j = 0; j < joints; ++j) {
    motion.q.col(j).setConstant(q0[j]);
    for (int l = 0; l < harmonics; ++l) {
      const double w = (l + 1) * base_frequency;
      const Eigen::ArrayXd c = (w * motion.t).array().cos(), s = (w * motion.t).array().sin();
      motion.q.col(j).array() += (a[l][j] * s - b[l][j] * c) / w;
      motion.dq.col(j).array() += a[l][j] * c + b[l][j] * s;
      motion.ddq.col(j).array() += w * (b[l][j] * c - a[l][j] * s);
    }
  }
  SimulateOptions options;
  options.measurement = MeasurementOptions::realistic();
  options.seed = seed;
  options.record_torques = false;
  return simulate(robot, {}, motion, options).log;
}

/// Measured and predicted torque of every joint; empty where there is no gnuplot.
std::string plot(const std::string& folder) {
  std::ostringstream text;
  text << "set terminal svg size 900,1260 dynamic font 'sans-serif,12' background 'white'\n"
       << "set datafile separator ','\nset multiplot layout 7,1\nset grid\nset key outside right\n"
       << "set xrange [0:21]\nset tmargin 0.6\nset bmargin 1.6\nset lmargin 9\nset rmargin 16\n";
  for (int j = 1; j <= joints; ++j) {
    text << "set ylabel 'joint " << j << " [N m]'\n"
         << (j == joints ? "set xlabel 't [s]'\nset bmargin 3\n" : "") << "plot '" << folder
         << "/log.csv' every 20 using 't':'tau" << j << "' with lines lc '#9aa7b5' title 'measured', '"
         << folder << "/torque.csv' every 20 using 't':'tau" << j
         << "' with lines lw 1.5 lc '#0b6fa4' title 'identified', '" << folder
         << "/torque.csv' every 20 using 't':'tauf" << j << "' with lines lc '#d1602f' title 'friction'\n";
  }
  text << "unset multiplot\n";
  return plot_svg(text.str(), "torques");
}

std::string report(const Identification& id, const Robot& truth, const std::string& picture) {
  const Eigen::VectorXd exact = id.base.K * parameter_vector(truth, id.base);
  std::ostringstream html;
  html << std::setprecision(4) << R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>dynid demo</title><style>
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #1d2733; }
h1 { font-size: 1.6em } h2 { font-size: 1.15em; margin-top: 2em }
table { border-collapse: collapse } th, td { padding: .2em .8em; text-align: right; border-bottom: 1px solid #dde3ea }
th { background: #f2f5f8 } td:first-child, th:first-child, td.left { text-align: left } svg { max-width: 100%; height: auto }
.lead { font-size: 1.1em }
</style></head><body><h1>A Panda, identified</h1><p class="lead">)"
       << id.rank << " coefficients from 21 s of the letter's exciting motion; relative error of the torques "
       << id.fit.relative_error_percent << " %, condition number " << id.condition_number
       << ".</p>\n<p>The log is a simulated robot's with the published parameters (Gaz et al. 2019, Tables "
          "VIII and IX, friction of "
          "eq. (25)) and a robot's electronics. What the checks found in it:</p><ul>\n";
  for (const DataIssue& issue : id.logs[0].report.issues)
    html << "<li><b>" << issue.name << "</b>: " << issue.text << "</li>\n";
  html << "</ul><h2>Torque error by joint, low-passed at " << id.cutoff
       << " Hz</h2><table><tr><th>rms [N m]</th>";
  for (int j = 1; j <= joints; ++j) html << "<th>" << j << "</th>";
  html << "</tr><tr><td>fit</td>";
  for (double x : id.fit.rmse) html << "<td>" << x << "</td>";
  if (id.validation) {
    html << "</tr><tr><td>held out</td>";
    for (double x : id.validation->rmse) html << "<td>" << x << "</td>";
  }
  html << "</tr></table>\n";
  if (!picture.empty()) html << "<h2>Torques</h2>\n" << picture;
  html << "<h2>Coefficients</h2><table><tr><th>name</th><th>identified</th><th>std</th><th>true</"
          "th><th>groups</th></tr>\n";
  for (std::size_t k = 0; k < id.coefficients.size(); ++k) {
    const Coefficient& c = id.coefficients[k];
    html << "<tr><td>" << c.name << (c.kept ? "" : " (dropped)") << "</td><td>" << c.value << "</td><td>"
         << std::abs(c.value) * c.std_percent / 100.0 << "</td><td>";
    if (static_cast<int>(k) < id.base.size()) html << exact[static_cast<Eigen::Index>(k)];
    html << "</td><td class=\"left\">" << c.expression << "</td></tr>\n";
  }
  html << "</table></body></html>\n";
  return html.str();
}

void run(const Arguments& args) {
  std::error_code error;
  std::filesystem::create_directories(args.out, error);
  if (error) throw Error(args.out + ": cannot be made: " + error.message());
  args.output.check();
  const Robot robot = read_model_file(args.robot).robot;
  if (robot.size() != joints) throw Error(args.robot + ": the demo's motion is for 7 joints");
  const Stopwatch watch;
  Progress progress(args.output);
  const std::string log_path = args.out + "/log.csv", torque_path = args.out + "/torque.csv";
  write_log(log_path, record(robot, args.seed));

  // From here on nothing is known but the log and the kinematics.
  Robot blind = robot;
  blind.set_parameters(Eigen::VectorXd::Zero(10 * joints));
  IdentifyOptions options;
  options.progress = [&progress](const std::string& stage, double fraction) { progress(stage, fraction); };
  const Log log = read_log(log_path, joints);
  const Identification id = identify(blind, {log}, {}, options);
  write_model(args.out + "/identified.yaml", {id.robot, id.coefficients, "identified from " + log_path});

  const PredictedTorque predicted = predict_torque(id.robot, log, id.cutoff);
  std::vector<std::string> names = {"t"};
  for (const char* prefix : {"tau", "tauf"})
    for (const std::string& name : column_names(prefix, joints)) names.push_back(name);
  Eigen::MatrixXd values(log.samples(), 1 + 2 * joints);
  values << predicted.t, predicted.tau, predicted.tau_f;
  write_table(torque_path, names, values);
  const std::string page = args.out + "/report.html";
  write_file(page, report(id, robot, plot(args.out)));

  args.output.write({{"rank", id.rank},
                     {"relative_error_percent", id.fit.relative_error_percent},
                     {"rmse", to_json(id.fit.rmse)},
                     {"report", page},
                     {"seconds", watch.seconds()}});
  if (!args.output.summary()) return;
  std::cout << "Identified " << id.rank << " coefficients of the Panda from " << log_path
            << ": relative error " << id.fit.relative_error_percent << " %\n  rms [N m]            "
            << in_a_row(id.fit.rmse) << "\n";
  if (id.validation) std::cout << "  rms held out [N m]   " << in_a_row(id.validation->rmse) << "\n";
  std::cout << "Model:  " << args.out << "/identified.yaml\nReport: " << page << "\n";
}

}  // namespace

void add_demo(CLI::App& app, int& status) {
  auto args = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("demo", "Make a log of the published Panda, identify it, write a report");
  command->add_option("--robot", args->robot, "The published Panda")
      ->type_name("FILE")
      ->capture_default_str();
  command->add_option("--out", args->out, "Folder for the log, the model and the report")
      ->type_name("FOLDER")
      ->capture_default_str();
  command->add_option("--seed", args->seed, "Seed of the log's noise")->capture_default_str();
  args->output.add_to(*command);
  command->footer("Example: dynid demo --out demo");
  command->callback([args, &status] {
    run(*args);
    status = 0;
  });
}

}  // namespace dynid
