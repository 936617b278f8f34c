// SPDX-License-Identifier: Apache-2.0
#include "series.hpp"

#include <algorithm>

#include "held_out.hpp"
#include "where.hpp"

namespace dynid::detail {
namespace {

/// The window of an effect of the model, in the log where it explains most.
GapWindow found_window(const Robot& robot, const GapRows& rows, const GapModel& model, std::size_t which,
                       const std::vector<std::string>& logs) {
  const UnitShape& u = model.effects[which].units.front();
  const Eigen::MatrixXd with =
      model.fit.left + contribution(rows, model, model.fit.theta, static_cast<std::ptrdiff_t>(which));
  std::vector<double> taken(logs.size(), 0.0);
  for (Eigen::Index i = 0; i < rows.size(); ++i)
    taken[static_cast<std::size_t>(rows.log[static_cast<std::size_t>(i)])] +=
        with.row(i).squaredNorm() - model.fit.left.row(i).squaredNorm();
  const auto log = std::max_element(taken.begin(), taken.end()) - taken.begin();
  return {logs[static_cast<std::size_t>(log)], u.shape[0], u.shape[0] + u.shape[1],
          model.effects[which].h->joints(robot, u.unit)};
}

/// In the place of those of its log that it meets.
void put_window(std::vector<GapWindow>& windows, const GapWindow& found) {
  windows.erase(std::remove_if(windows.begin(), windows.end(),
                               [&](const GapWindow& w) {
                                 return w.log == found.log && w.t0 < found.t1 && found.t0 < w.t1;
                               }),
                windows.end());
  windows.insert(windows.begin(), found);
}

}  // namespace

void put_series(const Robot& nominal, const GapRows& everything, const Choice& choice, const Judged& judged,
                const std::vector<std::string>& logs, Diagnosis& out) {
  const GapModel& model = judged.model;
  const bool adopted = adopts(judged.verdict), several = choice.split.several;
  const std::vector<bool>&first = choice.split.to_fit, &last = choice.split.to_judge;
  out.series = {everything.log, everything.t, everything.y, everything.y, last};
  Eigen::VectorXd theta = model.fit.theta;
  if (adopted && judged.within && several) {  // judged where it shows
    theta = fitted_within(choice.rows, model).fit.theta;
    out.series.held_out = alternate(everything, false, within_length(everything), 1);
    for (std::size_t i = 0; i < first.size(); ++i)
      out.series.held_out[i] = out.series.held_out[i] && first[i];
  }
  Eigen::MatrixXd passing = everything.y;  // without what is always there
  for (std::size_t k = 0; adopted && k < model.effects.size(); ++k) {
    Eigen::MatrixXd part = contribution(everything, model, theta, static_cast<std::ptrdiff_t>(k));
    const bool window = model.effects[k].h->scope() == Scope::window;
    if (several && window)  // a window is of the logs it was found in
      for (std::size_t i = 0; i < last.size(); ++i)
        if (last[i]) part.row(static_cast<Eigen::Index>(i)).setZero();
    out.series.after -= part;
    if (!window) passing -= part;
  }
  out.windows = windows(everything, passing, logs);
  for (std::size_t k = 0; adopted && k < model.effects.size(); ++k)
    if (model.effects[k].h->scope() == Scope::window)
      put_window(out.windows, found_window(nominal, choice.rows, model, k, logs));
}

}  // namespace dynid::detail
