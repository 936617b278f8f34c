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

/// ` x` of a vector, ` 2` of anything longer, `, joint 2` of what every joint has of its own.
std::string component(std::size_t size, std::size_t k, bool own) {
  static const char* const axes[] = {" x", " y", " z"};
  if (own) return ", joint " + std::to_string(k + 1);
  return size == 1 ? "" : size == 3 ? axes[k] : " " + std::to_string(k + 1);
}

/// One row for each number that was hidden: what was found of it.
json rows_of(const Effect& effect, const FoundEffect* found, Eigen::Index n) {
  json rows = json::array();
  for (const auto& [key, values] : effect.parameters)
    for (std::size_t k = 0; k < values.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k), size = static_cast<Eigen::Index>(values.size());
      const bool own = size == n && !effect.joints.empty();
      if (own && std::find(effect.joints.begin(), effect.joints.end(), k + 1) == effect.joints.end())
        continue;
      json row = {{"key", with_spaces(key) + component(values.size(), k, own)},
                  {"hidden", page_number(values[k])},
                  {"found", "\u2013"}};
      // A payload is hidden with its centre of mass from the flange, and found with it in the last link's
      // frame.
      if (found != nullptr && !(effect.name == "payload" && key == "com"))
        for (const ParameterEstimate& p : found->parameters)
          if (p.key == key && p.value.size() == size) {
            row["key"] = row["key"].get<std::string>() + (p.unit == "1" ? "" : " [" + p.unit + "]");
            row["found"] = page_number(p.value[i]);
            row["interval"] = page_number(p.low[i]) + " \u2026 " + page_number(p.high[i]);
          }
      rows.push_back(std::move(row));
    }
  return rows;
}

json hidden_view(const DemoReport& report) {
  json effects = json::array();
  for (const Effect& effect : report.hidden) {
    const FoundEffect* found = nullptr;
    bool alias = false;
    for (const FoundEffect& f : report.diagnosis.diagnosis.effects) {
      if (f.effect.name == effect.name) found = &f;
      alias = alias || std::find(f.aliases.begin(), f.aliases.end(), effect.name) != f.aliases.end();
    }
    json rows = rows_of(effect, found, report.truth.size());
    effects.push_back({{"name", capitalised(with_spaces(effect.name))},
                       {"how", found != nullptr ? "named"
                               : alias          ? "one of those that these logs cannot tell apart"
                                                : "not named"},
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
std::string four_digits(double x) { return short_number(x, 4); }

json row_view(const std::string& name, const Eigen::VectorXd& values) {
  json row = {{"name", name}, {"values", json::array()}};
  for (const double x : values) row["values"].push_back(four_digits(x));
  return row;
}

json coefficients_view(const Identification& id, const Eigen::VectorXd& exact) {
  json list = json::array();
  for (std::size_t k = 0; k < id.coefficients.size(); ++k) {
    const Coefficient& c = id.coefficients[k];
    list.push_back(
        {{"name", c.name + (c.kept ? "" : " (dropped)")},
         {"value", four_digits(c.value)},
         {"deviation", four_digits(std::abs(c.value) * c.std_percent / 100.0)},
         {"exact",
          static_cast<int>(k) < id.base.size() ? four_digits(exact[static_cast<Eigen::Index>(k)]) : ""},
         {"expression", c.expression}});
  }
  return list;
}

}  // namespace

std::string DemoReport::html(const std::string& command, const std::string& version) const {
  const Identification& id = identification;
  const std::optional<ModelFile> patch = diagnosis.patch();
  std::vector<PlotGroup> plots;
  json view = report_view(diagnosis.diagnosis, {truth.name, diagnosis.logs, command, version, false}, plots);
  plots.push_back(torque_plots(*this));
  view.update({{"any_hidden", !hidden.empty()},
               {"hidden", hidden_view(*this)},
               {"patched", patch.has_value()},
               {"entered", patch && patch->robot.effects.empty()},
               {"rank", id.rank},
               {"relative_error", four_digits(id.fit.relative_error_percent)},
               {"condition_number", four_digits(id.condition_number)},
               {"fit_cutoff", four_digits(id.cutoff)},
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
