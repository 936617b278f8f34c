// SPDX-License-Identifier: Apache-2.0
#include "next_experiment.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/signal/filter.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "effects/effects.hpp"

namespace dynid::detail {
namespace {

constexpr double rate = 100.0;      // [Hz] of candidate motions
constexpr double duration = 10.0;   // [s]
constexpr double told_apart = 4.0;  // D: a likelihood ratio of e^4
constexpr int points = 4;           // of an alias' shape grid, in each direction
constexpr double small = 0.04;      // of a motion's swing: where reversals turn

struct CandidateMotion {
  const char* what;  // imperative
  Trajectory motion;
};

/// A motion that turns `factor` times as often as the usual one, as large as the limits then allow.
Trajectory paced(const Robot& robot, double factor, unsigned long seed) {
  RandomMotionOptions options;
  options.rate = rate;
  options.margin = 0.8;
  options.base_frequency = 0.1 * factor;
  return random_motion(robot, duration, seed, options);
}

/// As `motion`, slowed down in time: the same path at `factor` times the speed.
Trajectory slowed(Trajectory motion, double factor) {
  const Eigen::VectorXd at = factor * motion.t;
  for (Eigen::Index j = 0; j < motion.q.cols(); ++j) {
    motion.q.col(j) = interpolate(motion.t, Eigen::VectorXd(motion.q.col(j)), at);
    motion.dq.col(j) = factor * interpolate(motion.t, Eigen::VectorXd(motion.dq.col(j)), at);
    motion.ddq.col(j) = factor * factor * interpolate(motion.t, Eigen::VectorXd(motion.ddq.col(j)), at);
  }
  return motion;
}

/// Small, quick turns about the middle of a larger motion.
Trajectory reversals(const Robot& robot, unsigned long seed) {
  RandomMotionOptions options;
  options.rate = rate;
  options.margin = 0.8;
  options.base_frequency = 0.4;
  Trajectory motion = random_motion(robot, duration, seed, options);
  for (Eigen::Index j = 0; j < motion.q.cols(); ++j) {
    const double middle = motion.q.col(j).mean();
    motion.q.col(j) = (middle + small * (motion.q.col(j).array() - middle)).matrix();
  }
  motion.dq *= small;
  motion.ddq *= small;
  return motion;
}

/// Poses held for a second, joined by quintic moves within the limits of speed.
Trajectory poses(const Robot& robot, const Trajectory& through) {
  Trajectory motion = through;
  motion.source = "static poses";
  constexpr double hold = 1.0, move = 1.5;
  const std::vector<JointScale> scales = joint_scales(robot);
  const auto stops = static_cast<Eigen::Index>(duration / (hold + move)) + 1;
  Eigen::MatrixXd at(stops, through.q.cols());
  for (Eigen::Index k = 0; k < stops; ++k) {
    at.row(k) = through.q.row(k * (through.samples() - 1) / stops);
    for (Eigen::Index j = 0; k > 0 && j < at.cols(); ++j) {
      const double speed = 0.8 * scales[static_cast<std::size_t>(j)].speed;
      const double reach = speed * move / 1.875;  // the quintic's peak speed
      at(k, j) = std::clamp(at(k, j), at(k - 1, j) - reach, at(k - 1, j) + reach);
    }
  }
  for (Eigen::Index i = 0; i < motion.samples(); ++i) {
    const double t = motion.t[i];
    const auto k = std::min<Eigen::Index>(stops - 1, static_cast<Eigen::Index>(t / (hold + move)));
    const double s = std::clamp((t - double(k) * (hold + move) - hold) / move, 0.0, 1.0);
    const Eigen::RowVectorXd by = at.row(std::min(stops - 1, k + 1)) - at.row(k);
    motion.q.row(i) = at.row(k) + by * (s * s * s * (10.0 + s * (-15.0 + 6.0 * s)));
    motion.dq.row(i) = by * (30.0 * s * s * (1.0 - s) * (1.0 - s) / move);
    motion.ddq.row(i) = by * (60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (move * move));
  }
  return motion;
}

GapMotion along(const Robot& nominal, const Trajectory& motion) {
  Segment segment;
  segment.rate = rate;
  segment.t = motion.t;
  segment.q = motion.q;
  segment.dq = motion.dq;
  segment.ddq = motion.ddq;
  segment.tau = Eigen::MatrixXd::Zero(motion.q.rows(), motion.q.cols());
  return GapMotion(nominal, segment, 0.0);
}

/// Columns of one unit as one matrix over all channels, in units of the floor: N n x p.
Eigen::MatrixXd weighted(const ColumnBlock& block, const GapMotion& motion, const Eigen::VectorXd& floor) {
  const Eigen::Index N = motion.samples();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(N * motion.joints(), block.values.front().cols());
  for (std::size_t k = 0; k < block.channels.size(); ++k)
    out.middleRows(N * block.channels[k], N) = block.values[k] / floor[block.channels[k]];
  return out;
}

/// Every combination of values of the shape parameters of one unit of an effect: as many for every unit.
std::vector<Eigen::VectorXd> shapes(const std::vector<ShapeParameter>& parameters) {
  std::vector<Eigen::VectorXd> all = {Eigen::VectorXd(0)};
  for (const ShapeParameter& p : parameters) {
    std::vector<Eigen::VectorXd> wider;
    const int count = std::min(points, std::max(1, p.points));
    for (const Eigen::VectorXd& s : all) {
      for (int k = 0; k < count; ++k) {
        const double part = count > 1 ? double(k) / (count - 1) : 0.5;
        Eigen::VectorXd next(s.size() + 1);
        next << s, p.at(part);
        wider.push_back(next);
      }
    }
    all = wider;
  }
  return all;
}

/// D of effect i, as it was found, against j at its best: how much of i's torque j cannot make.
double distinguishability(const Robot& robot, const Effect& i, const Hypothesis& j, const GapMotion& motion,
                          const Eigen::VectorXd& floor, double rows_per_sample) {
  const Hypothesis* h = find_hypothesis(i);
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(motion.samples() * robot.size());
  for (const int unit : units_of(*h, robot, i)) {
    Eigen::VectorXd c, shape;
    h->restore(robot, i, unit, c, shape);
    torque += weighted(h->columns(motion, unit, shape), motion, floor) * c;
  }
  // j on the joints that i has; one unit of it at a time where it has one only.
  double left = torque.squaredNorm();
  const bool several = j.scope() == Scope::joint;
  const std::vector<JointScale> scales =
      joint_scales(robot, motion.q, motion.dq, motion.ddq, Eigen::MatrixXd(), 1.0 / rate);
  std::vector<std::vector<Eigen::VectorXd>> tried;
  for (int unit = 0; unit < j.units(robot); ++unit)
    tried.push_back(shapes(j.shape_of(unit, scales, arm_reach(robot))));
  for (std::size_t k = 0; !tried.empty() && k < tried.front().size(); ++k) {
    std::vector<Eigen::MatrixXd> trials;
    Eigen::MatrixXd together(torque.size(), 0);
    for (int unit = 0; unit < j.units(robot); ++unit) {
      const Eigen::VectorXd& shape = tried[static_cast<std::size_t>(unit)][k];
      const Eigen::MatrixXd columns = weighted(j.columns(motion, unit, shape), motion, floor);
      if (!several) {
        trials.push_back(columns);
        continue;
      }
      if (std::find(i.joints.begin(), i.joints.end(), unit + 1) == i.joints.end()) continue;
      Eigen::MatrixXd wider(torque.size(), together.cols() + columns.cols());
      wider << together, columns;
      together = wider;
    }
    if (several && together.cols() > 0) trials.push_back(together);
    for (const Eigen::MatrixXd& columns : trials) {
      const Eigen::VectorXd rest =
          j.shape_only() ? Eigen::VectorXd(torque - columns.rowwise().sum())
                         : Eigen::VectorXd(torque - columns * columns.colPivHouseholderQr().solve(torque));
      left = std::min(left, rest.squaredNorm());
    }
  }
  return 0.5 * left * rows_per_sample;
}

NextExperiment without_alias(const Diagnosis& d) {
  NextExperiment next;
  switch (d.verdict) {
    case Verdict::no_gap:
      next.text = "Nothing is needed: model and robot agree on these logs.";
      break;
    case Verdict::not_detected:
      next.text =
          "What differs is within what noise and an inexact model may make. A longer log, or one that moves "
          "every joint faster and through more of its range, shows smaller effects.";
      break;
    case Verdict::explained:
      next.text = "Nothing is needed: no other effect of the catalogue explains these logs as well.";
      if (!d.shrink.held_out || d.logs.size() < 2)
        next.text +=
            " A second log of another motion would judge the answer more strictly than parts of this one.";
      break;
    case Verdict::partly_explained:
    case Verdict::unexplained: {
      next.text =
          "Repeat the same motion twice: what repeats is the robot's, what does not is its surroundings'.";
      const auto worst = std::max_element(
          d.where.begin(), d.where.end(),
          [](const GapCell& a, const GapCell& b) { return a.share / a.p_value < b.share / b.p_value; });
      if (worst != d.where.end())
        next.text += " Then move joint " + std::to_string(worst->joint) +
                     " alone, the others held, with most of the time in the regime '" + worst->regime +
                     "', where the gap is largest.";
      break;
    }
    case Verdict::misread:
      next.text = "Read the log as it is meant, with --assume auto, before anything is recorded again.";
      break;
    case Verdict::data_invalid:
      next.text = "Record the log again: see the data issues.";
  }
  return next;
}

}  // namespace

NextExperiment next_experiment(const Robot& nominal, const Diagnosis& diagnosis) {
  struct Pair {
    const FoundEffect* i;
    const Hypothesis* j;
  };
  std::vector<Pair> pairs;
  for (const FoundEffect& e : diagnosis.effects) {
    const Hypothesis* own = find_hypothesis(e.effect);
    if (own == nullptr || own->scope() == Scope::window) continue;
    for (const std::string& alias : e.aliases) {
      const Hypothesis* j = find_hypothesis(alias);
      if (j != nullptr && j->scope() != Scope::window && pairs.size() < 4) pairs.push_back({&e, j});
    }
  }
  if (pairs.empty()) return without_alias(diagnosis);

  constexpr unsigned long seed = 1;
  const Trajectory usual = paced(nominal, 1.0, seed);
  std::vector<CandidateMotion> candidates;
  candidates.push_back({"the same kind of motion again, within all limits", usual});
  candidates.push_back({"a slow motion, at 0.4 times the speed", slowed(usual, 0.4)});
  candidates.push_back({"a faster motion, turning 1.5 times as often", paced(nominal, 1.5, seed)});
  candidates.push_back(
      {"small reversals: turns of a twenty-fifth of the usual, several a second", reversals(nominal, seed)});
  candidates.push_back({"static poses, each held for a second", poses(nominal, usual)});

  const double rows_per_sample = std::min(1.0, 2.5 * diagnosis.cutoff / rate);
  std::vector<Eigen::VectorXd> separation;
  double best = -1.0;
  std::size_t chosen = 0;
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    const GapMotion motion = along(nominal, candidates[k].motion);
    Eigen::VectorXd d(static_cast<Eigen::Index>(pairs.size()));
    for (std::size_t p = 0; p < pairs.size(); ++p)
      d[static_cast<Eigen::Index>(p)] = distinguishability(nominal, pairs[p].i->effect, *pairs[p].j, motion,
                                                           diagnosis.floor, rows_per_sample);
    separation.push_back(d);
    if (d.minCoeff() > best) best = d.minCoeff(), chosen = k;
  }
  const Eigen::VectorXd& d = separation[chosen];
  NextExperiment next;
  std::vector<std::string> apart, together;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const std::string pair =
        with_spaces(pairs[p].i->effect.name) + " from " + with_spaces(pairs[p].j->name());
    const double here = d[static_cast<Eigen::Index>(p)];
    if (here >= told_apart) {
      apart.push_back(pair + " (D = " + short_number(here, 2) + ")");
      next.separates.emplace_back(pairs[p].i->effect.name, pairs[p].j->name());
    } else {
      together.push_back(pair);
    }
  }
  if (next.separates.empty()) {
    next.text =
        "No motion of those tried tells " + join(together) +
        ": what is needed is a known change of the robot itself, such as a known payload, or a sensor "
        "on the motor's side.";
    return next;
  }
  next.motion = candidates[chosen].motion;
  next.text = "Run " + std::string(candidates[chosen].what) + ": of " + std::to_string(candidates.size()) +
              " motions tried it tells apart best what this log does not: " + join(apart) +
              "; D of 4 is enough, a likelihood ratio of e^4.";
  if (!together.empty()) next.text += " It does not tell " + join(together) + ".";
  next.text += " Obstacles and self-collision were not looked at: check the motion before it runs.";
  return next;
}

}  // namespace dynid::detail
