// SPDX-License-Identifier: Apache-2.0
#include "where.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/base/statistics.hpp"

namespace dynid::detail {
namespace {

// Speeds below which a joint sticks, and slides no more than friction's bristles bend, in parts of its
// fastest.
constexpr double stuck_below = 0.003, presliding_below = 0.03;

}  // namespace

std::vector<Regime> regimes(const GapRows& rows) {
  const Eigen::Index n = rows.joints();
  std::vector<Regime> all;
  const auto add = [&](const char* name, const auto& inside) {
    Regime regime{name, Eigen::MatrixXd::Zero(rows.size(), n)};
    for (Eigen::Index j = 0; j < n; ++j)
      for (Eigen::Index i = 0; i < rows.size(); ++i) regime.inside(i, j) = inside(i, j) ? 1.0 : 0.0;
    all.push_back(std::move(regime));
  };
  Eigen::VectorXd speed(n), load(n), acceleration(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    speed[j] = median(rows.dq.col(j).cwiseAbs());
    load[j] = median(rows.load.col(j).cwiseAbs());
    acceleration[j] = median(rows.ddq.col(j).cwiseAbs());
  }
  Eigen::VectorXd stuck(n), presliding(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double fastest = rows.range[static_cast<std::size_t>(j)].scale.speed;
    stuck[j] = stuck_below * fastest;
    presliding[j] = presliding_below * fastest;
  }
  add("stuck", [&](Eigen::Index i, Eigen::Index j) { return std::abs(rows.dq(i, j)) < stuck[j]; });
  add("presliding", [&](Eigen::Index i, Eigen::Index j) {
    return std::abs(rows.dq(i, j)) >= stuck[j] && std::abs(rows.dq(i, j)) < presliding[j];
  });
  add("low speed", [&](Eigen::Index i, Eigen::Index j) {
    return std::abs(rows.dq(i, j)) >= presliding[j] && std::abs(rows.dq(i, j)) < speed[j];
  });
  add("high speed", [&](Eigen::Index i, Eigen::Index j) {
    return std::abs(rows.dq(i, j)) >= std::max(presliding[j], speed[j]);
  });
  add("forward", [&](Eigen::Index i, Eigen::Index j) { return rows.dq(i, j) > 0.0; });
  add("backward", [&](Eigen::Index i, Eigen::Index j) { return rows.dq(i, j) < 0.0; });
  add("low load", [&](Eigen::Index i, Eigen::Index j) { return std::abs(rows.load(i, j)) < load[j]; });
  add("high load", [&](Eigen::Index i, Eigen::Index j) { return std::abs(rows.load(i, j)) >= load[j]; });
  add("low acceleration",
      [&](Eigen::Index i, Eigen::Index j) { return std::abs(rows.ddq(i, j)) < acceleration[j]; });
  add("high acceleration",
      [&](Eigen::Index i, Eigen::Index j) { return std::abs(rows.ddq(i, j)) >= acceleration[j]; });
  const double end = rows.t.maxCoeff();
  add("first third", [&](Eigen::Index i, Eigen::Index) { return rows.t[i] < end / 3; });
  add("second third",
      [&](Eigen::Index i, Eigen::Index) { return rows.t[i] >= end / 3 && rows.t[i] < 2 * end / 3; });
  add("last third", [&](Eigen::Index i, Eigen::Index) { return rows.t[i] >= 2 * end / 3; });
  return all;
}

std::vector<GapCell> locate(const GapRows& rows, const Eigen::VectorXd& floor,
                            const std::vector<Eigen::MatrixXd>& surrogates) {
  const Eigen::MatrixXd energy = (rows.y * floor.cwiseInverse().asDiagonal()).cwiseAbs2();
  const double total = energy.sum();
  std::vector<GapCell> cells;
  for (const Regime& regime : regimes(rows)) {
    for (int j = 0; j < rows.joints(); ++j) {
      const double count = regime.inside.col(j).sum();
      if (count < 3.0) continue;
      GapCell cell;
      cell.joint = j + 1;
      cell.regime = regime.name;
      const double here = regime.inside.col(j).dot(energy.col(j));
      cell.share = total > 0.0 ? here / total : 0.0;
      int beyond = 1;
      for (const Eigen::MatrixXd& s : surrogates) {
        const Eigen::VectorXd e = (s.col(j) / floor[j]).cwiseAbs2();
        // Relative to the joint's own energy: a surrogate's differs by its mean.
        if (regime.inside.col(j).dot(e) * energy.col(j).sum() >= here * e.sum()) ++beyond;
      }
      cell.p_value = double(beyond) / double(surrogates.size() + 1);
      cells.push_back(cell);
    }
  }
  return cells;
}

std::vector<GapWindow> windows(const GapRows& rows, const Eigen::MatrixXd& gap,
                               const std::vector<std::string>& logs) {
  std::vector<GapWindow> found;
  const Eigen::Index reach = 3;
  for (int j = 0; j < rows.joints(); ++j) {
    const double usual = median(gap.col(j).cwiseAbs()) / 0.6745 + 1e-12;
    for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
      Eigen::Index first = -1, last = -1;
      const auto close = [&] {
        if (first >= 0 && last - first >= 4) {
          // The filter spreads an edge over time: it is where half of what is usual inside is reached.
          const double level = 0.5 * median(gap.col(j).segment(first, last - first + 1).cwiseAbs());
          while (std::abs(gap(first, j)) < level) ++first;
          while (std::abs(gap(last, j)) < level) --last;
          const int log = rows.log[static_cast<std::size_t>(first)];
          const double start = rows.start(log);
          found.push_back(
              {logs[static_cast<std::size_t>(log)], start + rows.t[first], start + rows.t[last], {j + 1}});
        }
        first = -1;
      };
      for (Eigen::Index i = rows.parts[p]; i < rows.parts[p + 1]; ++i) {
        if (std::abs(gap(i, j)) > 6.0 * usual) {
          if (first < 0) first = i;
          last = i;
        } else if (first >= 0 && i - last > reach) {
          close();
        }
      }
      close();
    }
  }
  // Joints that show the same stretch are one window.
  std::vector<GapWindow> merged;
  for (const GapWindow& w : found) {
    const auto same = std::find_if(merged.begin(), merged.end(), [&](const GapWindow& m) {
      return m.log == w.log && w.t0 < m.t1 && m.t0 < w.t1;
    });
    if (same == merged.end()) {
      merged.push_back(w);
    } else {
      same->t0 = std::min(same->t0, w.t0);
      same->t1 = std::max(same->t1, w.t1);
      same->joints.push_back(w.joints.front());
    }
  }
  return merged;
}

}  // namespace dynid::detail
