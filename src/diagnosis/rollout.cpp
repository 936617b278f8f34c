// SPDX-License-Identifier: Apache-2.0
#include "rollout.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/base/statistics.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/dynamics/forward_dynamics.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid::detail {
namespace {

constexpr double horizons[] = {0.1, 0.5, 1.0};  // [s], increasing
constexpr std::size_t most_starts = 40;
constexpr double shortest_step = 1e-3;  // [s]: dry friction of light joints asks for it

/// Forward dynamics of one model, stepped so that friction however steep stays stable.
class Replay {
 public:
  explicit Replay(const Robot& robot) : model_(robot), ws_(model_) {
    const int n = robot.size();
    rotor_.resize(n);
    armature_.resize(n);
    drive_.resize(n);
    a_.resize(n);
    for (int j = 0; j < n; ++j) {
      friction_.push_back(robot.joints[static_cast<std::size_t>(j)].friction);
      rotor_[j] = robot.joints[static_cast<std::size_t>(j)].rotor_inertia;
    }
  }

  /// One step of h [s] under the torque tau [N m] at its middle: positions at the middle, then the speed,
  /// friction on the new speed by its secant through rest (never pulling beyond rest), then the rest of the
  /// way.
  void step(Eigen::VectorXd& q, Eigen::VectorXd& v, const Eigen::VectorXd& tau, double h) {
    q += 0.5 * h * v;
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      const JointFriction& f = friction_[static_cast<std::size_t>(j)];
      const double rest = friction_torque(f, 0.0);
      const double at = std::copysign(std::max(std::abs(v[j]), 1e-4), v[j]);
      const double secant = std::max(0.0, (friction_torque(f, at) - rest) / at);
      drive_[j] = tau[j] - rest - secant * v[j];
      armature_[j] = rotor_[j] + h * secant;
    }
    dynid::forward_dynamics(model_, ws_, q, v, drive_, a_, armature_);
    v += h * a_;
    q += 0.5 * h * v;
  }

 private:
  Model<> model_;
  Workspace<> ws_;
  std::vector<JointFriction> friction_;
  Eigen::VectorXd rotor_, armature_, drive_, a_;
};

struct Start {
  std::size_t motion;
  Eigen::Index sample;
};

}  // namespace

Rollout roll_out(const Robot& nominal, const std::vector<FoundEffect>& effects, const GapRows& rows,
                 const std::vector<bool>& held_out) {
  const double longest = *std::max_element(std::begin(horizons), std::end(horizons));
  // One start a horizon, where all of it is held out.
  std::vector<Start> starts;
  const auto& motions = rows.motions();
  const int n = nominal.size();
  int log = 0;
  for (std::size_t i = 0; i < held_out.size(); ++i)
    if (held_out[i]) log = rows.log[i];
  for (std::size_t m = 0; m < motions.size(); ++m) {
    Eigen::Index row = rows.parts[m];
    const Eigen::Index end = rows.parts[m + 1];
    if (row == end || rows.log[static_cast<std::size_t>(row)] != log) continue;
    const auto steps = static_cast<Eigen::Index>(std::lround(longest * motions[m].rate));
    while (row < end) {
      if (!held_out[static_cast<std::size_t>(row)]) {
        ++row;
        continue;
      }
      const auto first =
          static_cast<Eigen::Index>(std::lround((rows.t[row] - motions[m].t[0]) * motions[m].rate));
      if (first + steps >= motions[m].samples()) break;
      starts.push_back({m, first});
      const double over = rows.t[row] + longest;
      while (row < end && rows.t[row] < over) ++row;
    }
  }
  if (starts.empty()) return {};
  if (starts.size() > most_starts) {
    std::vector<Start> some;
    for (std::size_t k = 0; k < most_starts; ++k) some.push_back(starts[k * starts.size() / most_starts]);
    starts = some;
  }

  std::vector<FoundEffect> here = effects;
  const bool other_log = rows.log.front() != rows.log.back();  // a window of time is not of this log
  // An effect of the caller's own has no place in a model.
  here.erase(std::remove_if(here.begin(), here.end(),
                            [&](const FoundEffect& e) {
                              const Hypothesis* h = find_hypothesis(e.effect);
                              return h == nullptr || (other_log && h->scope() == Scope::window);
                            }),
             here.end());
  const Robot with = patched(nominal, here);
  Replay replays[2] = {Replay(nominal), Replay(with)};
  // What a replay takes off the measured torque: what the nominal's own effects add, then with those found.
  std::vector<Eigen::MatrixXd> added[2] = {std::vector<Eigen::MatrixXd>(motions.size()),
                                           std::vector<Eigen::MatrixXd>(motions.size())};
  for (const Start& s : starts) {
    const GapMotion& m = motions[s.motion];
    if (added[1][s.motion].size() > 0) continue;
    added[0][s.motion] =
        m.known.size() > 0 ? m.known : Eigen::MatrixXd(Eigen::MatrixXd::Zero(m.samples(), n));
    added[1][s.motion] = added[0][s.motion] + effect_torque(with, m);
  }

  Rollout out;
  out.log = log;
  constexpr auto count = static_cast<Eigen::Index>(std::size(horizons));
  out.horizon = Eigen::Map<const Eigen::VectorXd>(horizons, count);
  Eigen::MatrixXd error[2];
  for (Eigen::MatrixXd& e : error) e.resize(static_cast<Eigen::Index>(starts.size()), count);
  std::vector<double> t;
  std::vector<int> start;
  std::vector<Eigen::RowVectorXd> measured, replayed[2];
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const GapMotion& m = motions[starts[k].motion];
    const Eigen::Index first = starts[k].sample;
    const auto steps = static_cast<Eigen::Index>(std::lround(longest * m.rate));
    for (Eigen::Index i = 0; i <= steps; ++i) {
      t.push_back(m.t[first + i]);
      start.push_back(static_cast<int>(k));
      measured.emplace_back(m.q.row(first + i));
    }
    const int sub = std::max(1, static_cast<int>(std::ceil(1.0 / (m.rate * shortest_step) - 1e-9)));
    for (int which = 0; which < 2; ++which) {
      Eigen::VectorXd q = m.q.row(first).transpose(), v = m.dq.row(first).transpose(), tau(n);
      replayed[which].emplace_back(q.transpose());
      for (Eigen::Index i = 0; i < steps; ++i) {
        for (int s = 0; s < sub; ++s) {
          const double part = (s + 0.5) / sub;
          tau = ((1.0 - part) * m.tau.row(first + i) + part * m.tau.row(first + i + 1)).transpose();
          const Eigen::MatrixXd& off = added[which][starts[k].motion];
          tau -= ((1.0 - part) * off.row(first + i) + part * off.row(first + i + 1)).transpose();
          replays[which].step(q, v, tau, 1.0 / (m.rate * sub));
        }
        replayed[which].emplace_back(q.transpose());
      }
      for (Eigen::Index h = 0; h < count; ++h) {
        const auto at = static_cast<Eigen::Index>(std::lround(horizons[h] * m.rate));
        const auto i = replayed[which].size() - 1 - static_cast<std::size_t>(steps - at);
        error[which](static_cast<Eigen::Index>(k), h) =
            (replayed[which][i] - m.q.row(first + at)).norm() / std::sqrt(double(n));
      }
    }
  }
  if (!error[0].allFinite() || !error[1].allFinite()) return {};
  out.before = column_medians(error[0]);
  out.after = column_medians(error[1]);
  const auto size = static_cast<Eigen::Index>(t.size());
  out.t = Eigen::Map<Eigen::VectorXd>(t.data(), size);
  out.start = Eigen::Map<Eigen::VectorXi>(start.data(), size);
  out.q.resize(size, n);
  out.without.resize(size, n);
  out.with.resize(size, n);
  for (Eigen::Index i = 0; i < size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    out.q.row(i) = measured[k];
    out.without.row(i) = replayed[0][k];
    out.with.row(i) = replayed[1][k];
  }
  return out;
}

}  // namespace dynid::detail
