// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <iomanip>
#include <sstream>

#include "base/plot.hpp"
#include "dynid/app/demo.hpp"

namespace dynid {
namespace {

/// Measured and predicted torque of every joint; empty where there is no gnuplot.
std::string plot(const DemoReport& report) {
  const Eigen::Index n = report.log.tau.cols(), rows = report.log.samples();
  constexpr Eigen::Index every = 20;
  std::ostringstream text;
  text << std::setprecision(9) << "$d << END\n";
  for (Eigen::Index i = 0; i < rows; i += every) {
    text << report.log.t[i];
    for (const Eigen::MatrixXd* torque : {&report.log.tau, &report.predicted.tau, &report.predicted.tau_f})
      for (Eigen::Index j = 0; j < n; ++j) text << ' ' << (*torque)(i, j);
    text << '\n';
  }
  text << "END\nset terminal svg size 900,1260 dynamic font 'sans-serif,12' background 'white'\n"
       << "set multiplot layout " << n << ",1\nset grid\nset key outside right\n"
       << "set xrange [0:21]\nset tmargin 0.6\nset bmargin 1.6\nset lmargin 9\nset rmargin 16\n";
  for (Eigen::Index j = 1; j <= n; ++j)
    text << "set ylabel 'joint " << j << " [N m]'\n"
         << (j == n ? "set xlabel 't [s]'\nset bmargin 3\n" : "") << "plot $d using 1:" << j + 1
         << " with lines lc '#9aa7b5' title 'measured', $d using 1:" << n + j + 1
         << " with lines lw 1.5 lc '#0b6fa4' title 'identified', $d using 1:" << 2 * n + j + 1
         << " with lines lc '#d1602f' title 'friction'\n";
  text << "unset multiplot\n";
  return plot_svg(text.str(), "torques");
}

}  // namespace

std::string DemoReport::html() const {
  const Identification& id = identification;
  const std::string picture = plot(*this);
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
  for (int j = 1; j <= truth.size(); ++j) html << "<th>" << j << "</th>";
  html << "</tr><tr><td>fit</td>";
  for (const double x : id.fit.rmse) html << "<td>" << x << "</td>";
  if (id.validation) {
    html << "</tr><tr><td>held out</td>";
    for (const double x : id.validation->rmse) html << "<td>" << x << "</td>";
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

}  // namespace dynid
