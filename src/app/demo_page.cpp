// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/page.hpp"
#include "dynid/app/demo.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "report_view.hpp"
#include "report_words.hpp"

namespace dynid {
namespace {

using nlohmann::json;
using namespace detail;

constexpr Eigen::Index width = 400;  // [px]
constexpr int shown = 4;             // joints, at first

/// Measured and predicted torque of every joint.
PlotGroup torque_plots(const DemoReport& report) {
  const Eigen::Index n = report.log.tau.cols(), rows = report.log.samples();
  Eigen::MatrixXd columns(rows, 3 * n);
  columns << report.log.tau, report.predicted.tau, report.predicted.tau_f;
  PlotGroup group = thinned(report.log.t, columns, {}, width);
  group.id = "torques";
  for (Eigen::Index j = 0; j < n; ++j) {
    const int column = static_cast<int>(j), of = static_cast<int>(n);
    double low = 0.0, high = 0.0;
    for (int k = 0; k < 3; ++k) {
      low = std::min(low, 1.08 * columns.col(k * n + j).minCoeff());
      high = std::max(high, 1.08 * columns.col(k * n + j).maxCoeff());
    }
    Plot plot;
    plot.joint = column + 1;
    plot.caption = "Joint " + std::to_string(plot.joint);
    plot.label = "Torque of joint " + std::to_string(plot.joint) +
                 " over time: measured, identified (they differ by " +
                 page_number(report.identification.fit.rmse[j]) +
                 " N m rms when low-passed) and its friction.";
    plot.axis = "torque [N m]";
    plot.shown = column < shown;
    plot.low = low;
    plot.high = high;
    plot.lines = {{"measured", "--floor", column, -1, 1.6},
                  {"identified", "--after", of + column},
                  {"friction", "--before", 2 * of + column}};
    group.plots.push_back(std::move(plot));
  }
  return group;
}

/// One row for each number that was hidden: what was found of it.
json hidden_view(const DemoReport& report) {
  json effects = json::array();
  const Eigen::Index n = report.truth.size();
  for (const Effect& effect : report.hidden) {
    const FoundEffect* found = nullptr;
    for (const FoundEffect& f : report.diagnosis.diagnosis.effects)
      if (f.effect.name == effect.name) found = &f;
    json rows = json::array();
    for (const auto& [key, values] : effect.parameters)
      for (std::size_t k = 0; k < values.size(); ++k) {
        const bool own = static_cast<Eigen::Index>(values.size()) == n && !effect.joints.empty();
        const int joint = static_cast<int>(k) + 1;
        if (own && std::find(effect.joints.begin(), effect.joints.end(), joint) == effect.joints.end())
          continue;
        json row = {{"key", with_spaces(key) + (own                 ? ", joint " + std::to_string(joint)
                                                : values.size() > 1 ? " " + std::to_string(joint)
                                                                    : "")},
                    {"hidden", page_number(values[k])},
                    {"found", "\u2013"}};
        if (found != nullptr)
          for (const ParameterEstimate& p : found->parameters)
            if (p.key == key && p.value.size() == static_cast<Eigen::Index>(values.size())) {
              const auto i = static_cast<Eigen::Index>(k);
              row["key"] = row["key"].get<std::string>() + (p.unit == "1" ? "" : " [" + p.unit + "]");
              row["found"] = page_number(p.value[i]);
              row["interval"] = page_number(p.low[i]) + " \u2026 " + page_number(p.high[i]);
            }
        rows.push_back(std::move(row));
      }
    effects.push_back({{"name", capitalised(with_spaces(effect.name))},
                       {"named", found != nullptr},
                       {"any_row", !rows.empty()},
                       {"rows", std::move(rows)}});
  }
  return effects;
}

json links_view(const RetrievalResult& result) {
  json links = json::array();
  for (std::size_t k = 0; k < result.links.size(); ++k) {
    const LinkInertia& link = result.links[k];
    json com = json::array();
    for (const double x : link.com) com.push_back(page_number(x));
    links.push_back({{"link", k + 1}, {"mass", page_number(link.mass)}, {"com", com}});
  }
  return links;
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

std::string DemoReport::html(const std::string& command, const std::string& version) const {
  const Identification& id = identification;
  std::vector<PlotGroup> plots;
  json view = report_view(diagnosis.diagnosis, {truth.name, diagnosis.logs, command, version, false}, plots);
  plots.push_back(torque_plots(*this));
  view.update({{"any_hidden", !hidden.empty()},
               {"hidden", hidden_view(*this)},
               {"patched", diagnosis.patch().has_value()},
               {"rank", id.rank},
               {"relative_error", figure(id.fit.relative_error_percent)},
               {"condition_number", figure(id.condition_number)},
               {"fit_cutoff", figure(id.cutoff)},
               {"identification_issues", json::array()},
               {"joint_numbers", json::array()},
               {"errors", json::array({row_view("fit", id.fit.rmse)})},
               {"torques", plots_view(plots.back())},
               {"total_mass", page_number(retrieval.result.total_mass)},
               {"links", links_view(retrieval.result)}});
  for (const DataIssue& issue : id.logs[0].report.issues)
    view["identification_issues"].push_back({{"name", issue.name}, {"text", issue.text}});
  for (int j = 1; j <= truth.size(); ++j) view["joint_numbers"].push_back(j);
  if (id.validation) view["errors"].push_back(row_view("held out", id.validation->rmse));
  view["coefficients"] = coefficients_view(id, id.base.K * parameter_vector(truth, id.base));
  add_plot_data(plots, view);
  return rendered_page("demo", view);
}

}  // namespace dynid
