// SPDX-License-Identifier: Apache-2.0
#include "spread.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace dynid::detail {
namespace {

constexpr int bins = 8;  // of a joint's range of positions, speeds, accelerations, loads

/// A window, and what is to be known of it to choose it.
struct Place {
  RowWindow rows;
  double loudness = 0.0;  // mean square of its gap, joints in units of their floors
  std::vector<int> regimes;
  bool chosen = false;
};

/// The bins that the joints visit in a window: regimes of one signal, counted from `first` on.
void visit(const Eigen::MatrixXd& signal, const RowWindow& rows, int first, std::vector<int>& regimes) {
  for (Eigen::Index j = 0; j < signal.cols(); ++j) {
    const double low = signal.col(j).minCoeff(), width = signal.col(j).maxCoeff() - low;
    std::vector<bool> seen(bins, false);
    for (const double x : signal.col(j).segment(rows.first, rows.count))
      seen[static_cast<std::size_t>(
          width > 0.0 ? std::clamp(static_cast<int>(bins * (x - low) / width), 0, bins - 1) : 0)] = true;
    for (int k = 0; k < bins; ++k)
      if (seen[static_cast<std::size_t>(k)]) regimes.push_back(first + static_cast<int>(j) * bins + k);
  }
}

std::vector<Place> places_of(const GapRows& rows, int log, Eigen::Index size) {
  std::vector<Place> out;
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
    const Eigen::Index end = rows.parts[p + 1];
    if (rows.parts[p] == end || rows.log[static_cast<std::size_t>(rows.parts[p])] != log) continue;
    for (Eigen::Index first = rows.parts[p]; first < end; first += size) {
      const Eigen::Index count = std::min(size, end - first);
      if (2 * count < size && first > rows.parts[p]) continue;  // the rest of a stretch
      Place place;
      place.rows = {first, count};
      out.push_back(place);
    }
  }
  return out;
}

/// The next that covers most of what is not covered yet; of several the one farthest in time from the others.
std::size_t next_of(const GapRows& rows, const std::vector<Place>& places, const std::set<int>& covered) {
  std::size_t best = 0, most = 0;
  double farthest = -1.0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    if (places[k].chosen) continue;
    std::size_t fresh = 0;
    for (const int regime : places[k].regimes) fresh += covered.count(regime) == 0 ? 1U : 0U;
    double distance = std::numeric_limits<double>::infinity();
    for (const Place& other : places)
      if (other.chosen)
        distance = std::min(distance, std::abs(rows.t[other.rows.first] - rows.t[places[k].rows.first]));
    if (fresh > most || (fresh == most && distance > farthest)) best = k, most = fresh, farthest = distance;
  }
  return best;
}

}  // namespace

std::vector<RowWindow> spread_windows(const GapRows& rows, const Criteria& criteria) {
  const int logs = rows.log.back() + 1;
  const std::size_t wanted = std::max<std::size_t>(
      1, static_cast<std::size_t>(criteria.searched_rows / (criteria.window_rows * logs)));
  const Eigen::MatrixXd* const signals[] = {&rows.q, &rows.dq, &rows.ddq, &rows.load};
  std::vector<RowWindow> out;
  for (int log = 0; log < logs; ++log) {
    std::vector<Place> places = places_of(rows, log, criteria.window_rows);
    for (Place& place : places) {
      const auto gap = rows.y.middleRows(place.rows.first, place.rows.count);
      place.loudness =
          (gap * rows.white_floor.cwiseInverse().asDiagonal()).squaredNorm() / double(gap.rows());
      int first = 0;
      for (const Eigen::MatrixXd* signal : signals) {
        visit(*signal, place.rows, first, place.regimes);
        first += bins * rows.joints();
      }
    }
    const std::size_t count = std::min(wanted, places.size()),
                      loud = static_cast<std::size_t>(criteria.loud_windows * double(count));
    std::set<int> covered;
    for (std::size_t k = 0; k < count; ++k) {
      std::size_t next = 0;
      if (k < loud) {
        double loudest = -1.0;
        for (std::size_t i = 0; i < places.size(); ++i)
          if (!places[i].chosen && places[i].loudness > loudest) next = i, loudest = places[i].loudness;
      } else {
        next = next_of(rows, places, covered);
      }
      places[next].chosen = true;
      covered.insert(places[next].regimes.begin(), places[next].regimes.end());
    }
    for (const Place& place : places)
      if (place.chosen) out.push_back(place.rows);
  }
  return out;
}

}  // namespace dynid::detail
