// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/conventions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "conventions_search.hpp"
#include "dynid/base/error.hpp"

namespace dynid {
namespace {

using namespace detail;

/// Joints whose torque stays at its own largest or smallest value: what it would have been is not known.
std::vector<bool> clipped_joints(const std::vector<Log>& logs, double most) {
  std::vector<bool> out;
  for (int j = 0; !logs.empty() && j < logs.front().joints(); ++j) {
    double at_limit = 0.0, samples = 0.0;
    for (const Log& log : logs) {
      if (log.tau.size() == 0 || log.tau.col(j).maxCoeff() == log.tau.col(j).minCoeff()) continue;
      const auto tau = log.tau.col(j).array();
      at_limit += double((tau == tau.maxCoeff() || tau == tau.minCoeff()).count());
      samples += double(tau.size());
    }
    out.push_back(at_limit > most * samples);
  }
  return out;
}

/// How much better a reading does than the log as it stands, over the joints that tell: each counts by what
/// the reading changes on it.
struct ReadingGain {
  double before = 0.0, after = 0.0;  ///< explained
  double gain = 0.0;                 ///< log of the residual's fall
  double weight = 0.0;               ///< evidence
  bool spoils = false;               ///< a joint that was explained is no more
};

ReadingGain gain_of(const Eigen::VectorXd& as_is, const Eigen::VectorXd& read,
                    const std::vector<bool>& clipped, const ConventionOptions& options) {
  ReadingGain out;
  const double e = options.model_error;
  for (Eigen::Index j = 0; j < as_is.size(); ++j) {
    if (clipped[static_cast<std::size_t>(j)]) continue;
    const double was = std::min(as_is[j], options.worst), is = std::min(read[j], options.worst);
    out.spoils = out.spoils || (was < 0.5 && is > std::max(0.7, 1.5 * was));
    const double w = std::log((was + e) / (is + e));
    if (w < options.least_weight) continue;
    out.weight += w;
    out.before += w * (1.0 - was);
    out.after += w * (1.0 - is);
    out.gain += w * std::log(was / std::max(is, 1e-3));
  }
  if (out.weight > 0.0) out.before /= out.weight, out.after /= out.weight, out.gain /= out.weight;
  return out;
}

/// Only the zero of the last joint is another: a payload, or an error of the last link, by another name.
bool only_last_zero(const Reading& r, const Reading& plain) {
  const auto n = r.zero.size();
  return n > 1 && r.zero[n - 1] != 0.0 && r.zero.head(n - 1).isZero(0.0) && r.order == plain.order &&
         r.sign == plain.sign && r.torque_sign == plain.torque_sign && r.factor == plain.factor &&
         r.position_unit == 1.0 && !r.without_gravity && !r.magnitude && !r.turned_gravity;
}

std::string undecided_sentence(const ConventionReport& report, double explained) {
  char figures[96];
  std::snprintf(figures, sizeof figures,
                "the model explains %.0f %% of the torques as the log stands, and %.0f %%",
                100.0 * std::max(report.explained, 0.0), 100.0 * explained);
  std::string text = std::string(figures) + " where it is read with --assume " + report.undecided.front();
  for (std::size_t k = 1; k < report.undecided.size() && k < 3; ++k)
    text += " (or " + report.undecided[k] + ")";
  return text +
         ", but a body that the arm carries, or other masses than the model's, would do the same: the log "
         "cannot tell which";
}

/// The two say the same of motion and gravity, and make the torques about as large.
bool nearly_same(const Reading& a, const Reading& b) {
  const auto torque = [](const Reading& r) { return r.torque_sign.cwiseProduct(r.factor).eval(); };
  return a.order == b.order && a.sign == b.sign && a.zero == b.zero && a.position_unit == b.position_unit &&
         a.without_gravity == b.without_gravity && a.magnitude == b.magnitude && a.gravity == b.gravity &&
         (torque(a) - torque(b)).norm() < 0.3 * torque(a).norm();
}

/// The reading is another than the plain one in what it says of a single joint, and in nothing else.
bool concerns_one_joint(const Reading& r, const Reading& plain) {
  if (r.position_unit != plain.position_unit || r.without_gravity || r.magnitude || r.turned_gravity ||
      r.unit_of_torque)
    return false;
  int count = 0;
  for (Eigen::Index j = 0; j < r.sign.size(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    if (r.order[at] != plain.order[at] || r.sign[j] != plain.sign[j] || r.zero[j] != plain.zero[j] ||
        r.torque_sign[j] != plain.torque_sign[j] || r.factor[j] != plain.factor[j])
      ++count;
  }
  return count == 1;
}

/// The best reading of one joint is told from the next that says something else.
bool leads(const std::vector<ReadingCandidate>& found, double least) {
  for (std::size_t k = 1; k < found.size(); ++k)
    if (!nearly_same(found[0].reading, found[k].reading)) return found[k].score - found[0].score > least;
  return true;
}

/// Readings that would be misreadings but that what the arm carries explains the log as well, or that another
/// reading of a single joint does. `found`: best first.
std::vector<const ReadingCandidate*> undecided(const std::vector<ReadingCandidate>& found,
                                               const ReadingCandidate& bare, const ReadingCandidate& loaded,
                                               const std::vector<bool>& clipped,
                                               const ConventionOptions& options) {
  std::vector<const ReadingCandidate*> out;
  const bool one = bare.left.size() == 1;
  for (const ReadingCandidate& c : found) {
    if (c.score > found.front().score + options.most_further) break;
    if (c.score > loaded.score + options.most_further) continue;
    const ReadingGain g = gain_of(bare.left, c.left, clipped, options);
    if (g.weight == 0.0 || g.spoils || !(g.before < options.most_before)) continue;
    if (g.after > (one ? options.least_after_alone : options.least_after) &&
        g.gain > std::log(one ? options.least_gain_alone : options.least_gain))
      out.push_back(&c);
  }
  return out;
}

/// The reading without those parts that the log does not bear out, the rest being so: of what a part
/// concerns, the model has to explain most with it, and to do better with it than without. A wrist whose
/// model is poor takes any zero that helps it a little.
ReadingCandidate needed_parts(ConventionSearch& search, ReadingCandidate c, const std::vector<bool>& clipped,
                              const ConventionOptions& options) {
  for (;;) {
    const std::vector<Reading> simpler = search.without_a_part(c.reading);
    if (simpler.size() < 2) return c;
    std::optional<ReadingCandidate> best;
    for (const Reading& r : simpler) {
      ReadingCandidate rest = search.judged_loaded(r);
      const ReadingGain g = gain_of(rest.left, c.left, clipped, options);
      if (rest.score > c.score && g.weight > 0.0 && g.after > options.most_before) continue;
      if (!best || rest.score < best->score) best = std::move(rest);
    }
    if (!best) return c;
    c = std::move(*best);
  }
}

/// `found`: best first.
bool is_misreading(const ReadingGain& g, const std::vector<ReadingCandidate>& found,
                   const ConventionOptions& options) {
  if (g.weight == 0.0 || g.spoils) return false;
  const bool one = found.front().left.size() == 1;
  const bool clear = g.after > options.least_after_clear && g.gain > std::log(options.least_gain_clear);
  if (!(g.before < (clear && !one ? options.most_before_clear : options.most_before))) return false;
  if (!one) return g.after > options.least_after && g.gain > std::log(options.least_gain);
  // One joint has little to tell readings by.
  return g.after > options.least_after_alone && g.gain > std::log(options.least_gain_alone) &&
         leads(found, options.least_lead_alone);
}

}  // namespace

ConventionReport find_conventions(const Robot& nominal, const std::vector<Log>& logs,
                                  const ConventionOptions& options) {
  const int n = nominal.size();
  for (const Log& log : logs)
    if (log.joints() != n)
      throw Error(log.source + ": the log has " + std::to_string(log.joints()) + " joints, the robot has " +
                  std::to_string(n));
  ConventionReport report;
  const SpreadRows rows = detail::spread_rows(logs, options.rows);
  if (rows.q.rows() < some_rows) return report;
  const VelocityReading kinematics = compare_velocity(rows);
  const bool model = !nominal.parameters().isZero(0.0) && rows.tau.size() > 0;

  Reading plain;
  bool fire = false;
  const ReadingCandidate* best = nullptr;
  double before = 0.0, after = 0.0;
  std::optional<ConventionSearch> search;
  std::vector<ReadingCandidate> everything;  // those with no other zero than the last joint's too
  std::vector<const ReadingCandidate*> open;
  if (model) {
    search.emplace(nominal, rows, options);
    plain = search->plain();
    plain.time_unit = kinematics.time_unit;
    search->run(plain);
    search->sort();
    report.explained = 1.0 - search->before().left.cwiseMin(options.worst).mean();
    if (!search->found().empty()) {
      const std::vector<bool> clipped = clipped_joints(logs, options.most_clipped);
      search->add_free_factors();
      // The best few once more, on an arm that may carry something.
      ReadingCandidate as_is = search->with_payload(search->before());
      std::vector<ReadingCandidate>& found = search->found();
      for (std::size_t k = 0; k < std::min(found.size(), options.tried_again); ++k)
        found[k] = search->with_payload(found[k]);
      found.resize(std::min(found.size(), options.tried_again));
      const auto last_zeros =
          std::stable_partition(found.begin(), found.end(),
                                [&](const ReadingCandidate& c) { return !only_last_zero(c.reading, plain); });
      everything.assign(last_zeros, found.end());
      found.erase(last_zeros, found.end());
      search->sort();
      everything.insert(everything.end(), found.begin(), found.end());
      std::stable_sort(
          everything.begin(), everything.end(),
          [](const ReadingCandidate& a, const ReadingCandidate& b) { return a.score < b.score; });
      // What is said of one joint alone may as well be one link that is wrong.
      if (!everything.empty() && concerns_one_joint(everything.front().reading, plain))
        as_is = search->with_wrong_body(search->before());
      if (!everything.empty()) open = undecided(everything, search->before(), as_is, clipped, options);
      if (!found.empty()) {
        found.front() = needed_parts(*search, found.front(), clipped, options);
        best = &found.front();
        const ReadingGain g = gain_of(as_is.left, best->left, clipped, options);
        before = g.before, after = g.after;
        fire = search->needs_body(*best) && is_misreading(g, found, options);
      }
    }
  }
  if (fire) {
    report.conventions = conventions_of(best->reading, nominal, kinematics, search->felt(best->reading));
  } else if (kinematics.time_unit != 1.0 || kinematics.velocity_unit != 1.0 || kinematics.unrelated) {
    Reading as_is = model ? plain : Reading{};
    if (!model) {
      as_is.order.resize(n);
      std::iota(as_is.order.begin(), as_is.order.end(), 0);
      as_is.sign = as_is.torque_sign = as_is.factor = Eigen::VectorXd::Ones(n);
      as_is.zero = Eigen::VectorXd::Zero(n);
      as_is.time_unit = kinematics.time_unit;
    }
    report.conventions = conventions_of(as_is, nominal, kinematics);
  }
  if (!fire && !open.empty()) {
    for (const ReadingCandidate* c : open) {
      const std::string assume = joined(conventions_of(c->reading, nominal, kinematics));
      const auto& list = report.undecided;
      if (std::find(list.begin(), list.end(), assume) == list.end()) report.undecided.push_back(assume);
    }
    report.undecided_text =
        undecided_sentence(report, 1.0 - open.front()->left.cwiseMin(options.worst).mean());
  }
  for (Convention& c : report.conventions) {
    const bool of_motion = c.name == "time_unit" || c.name == "velocity_unit";
    c.explained_before = of_motion ? kinematics.before : before;
    c.explained_after = of_motion ? kinematics.after : after;
  }
  report.assume = joined(report.conventions);
  if (fire) {
    for (const ReadingCandidate& c : search->found()) {
      const std::string assume = joined(conventions_of(c.reading, nominal, kinematics));
      if (assume == report.assume || assume.empty()) continue;
      report.runner_up = assume;
      report.runner_up_explained = 1.0 - c.left.cwiseMin(options.worst).mean();
      break;
    }
    for (const ReadingCandidate& c : search->found()) {
      if (c.reading.complexity > best->reading.complexity + options.most_further) continue;
      const std::string assume = joined(conventions_of(c.reading, nominal, kinematics));
      if (assume == report.assume || assume.empty() || !search->equivalent(best->reading, c.reading))
        continue;
      report.equivalents.push_back(assume);
    }
  }
  return report;
}

}  // namespace dynid
