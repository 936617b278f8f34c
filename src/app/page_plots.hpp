// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace dynid::detail {

/// One line of a plot over time: a column of its group or, where `less` names another one, a thousand times
/// the magnitude of their difference.
struct PlotLine {
  std::string name;      ///< for the readout
  const char* property;  ///< of the page's style, that has the colour
  int column = 0, less = -1;
  double width = 1.6;  ///< [px]
};

/// One plot of a joint.
struct Plot {
  int joint = 1;
  std::string caption, label, axis;  ///< `label`: what it shows in words, for who does not see it
  bool shown = true;                 ///< at first
  bool logarithmic = false;
  double low = -1.0, high = 1.0;  ///< of the axis
  double band = 0.0;              ///< half the width of the band that is shaded about zero; none where zero
  std::vector<PlotLine> lines;
};

/// Plots over one time axis, whose cursors and zoom go together. A row that is not a number breaks the lines.
struct PlotGroup {
  std::string id;
  Eigen::VectorXd t;
  Eigen::MatrixXd columns;
  std::vector<std::pair<double, double>> shaded;  ///< stretches of time
  std::vector<Plot> plots;
};

/// Rows (`t` N, `columns` N x n) thinned to what `width` pixels can show: of the rows of each pixel the least
/// and the largest value of every column, in the order in which they came. Where `fresh` is true a stretch
/// begins, and the lines break. At most 2 `width` rows and three a stretch more; what is shorter stays as it
/// is.
PlotGroup thinned(const Eigen::VectorXd& t, const Eigen::MatrixXd& columns, const std::vector<bool>& fresh,
                  Eigen::Index width);

/// What src/app/page/plots.html shows of a group: a figure for each plot, with gnuplot's drawing of it where
/// it is shown at first (and gnuplot is there).
nlohmann::json plots_view(const PlotGroup& group);

/// Adds to a page's view what its script draws from, of all its groups: `live`, `plot_data`. Without a
/// plotter in the program, nothing.
void add_plot_data(const std::vector<PlotGroup>& groups, nlohmann::json& view);

}  // namespace dynid::detail
