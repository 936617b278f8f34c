// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/page.hpp"
#include "base/plot.hpp"
#include "dynid/app/demo.hpp"
#include "dynid/base/number.hpp"

namespace dynid {
namespace {

using nlohmann::json;

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

/// Four significant digits.
std::string figure(double x) { return short_number(x, 4); }

json row_view(const std::string& name, const Eigen::VectorXd& values) {
  json row = {{"name", name}, {"values", json::array()}};
  for (const double x : values) row["values"].push_back(figure(x));
  return row;
}

json coefficients_view(const Identification& id, const Eigen::VectorXd& exact) {
  json list = json::array();
  for (std::size_t k = 0; k < id.coefficients.size(); ++k) {
    const Coefficient& c = id.coefficients[k];
    list.push_back(
        {{"name", c.name + (c.kept ? "" : " (dropped)")},
         {"value", figure(c.value)},
         {"deviation", figure(std::abs(c.value) * c.std_percent / 100.0)},
         {"exact", static_cast<int>(k) < id.base.size() ? figure(exact[static_cast<Eigen::Index>(k)]) : ""},
         {"expression", c.expression}});
  }
  return list;
}

}  // namespace

std::string DemoReport::html() const {
  const Identification& id = identification;
  json view = {{"rank", id.rank},
               {"relative_error", figure(id.fit.relative_error_percent)},
               {"condition_number", figure(id.condition_number)},
               {"cutoff", figure(id.cutoff)},
               {"issues", json::array()},
               {"joints", json::array()},
               {"errors", json::array({row_view("fit", id.fit.rmse)})},
               {"plots", json::array()}};
  for (const DataIssue& issue : id.logs[0].report.issues)
    view["issues"].push_back({{"name", issue.name}, {"text", issue.text}});
  for (int j = 1; j <= truth.size(); ++j) view["joints"].push_back(j);
  if (id.validation) view["errors"].push_back(row_view("held out", id.validation->rmse));
  if (std::string svg = plot(*this); !svg.empty())
    view["plots"].push_back({{"caption", "Measured, identified, and its friction"}, {"svg", std::move(svg)}});
  view["any_plot"] = !view["plots"].empty();
  view["coefficients"] = coefficients_view(id, id.base.K * parameter_vector(truth, id.base));
  return rendered_page("demo", view);
}

}  // namespace dynid
