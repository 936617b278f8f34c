// SPDX-License-Identifier: Apache-2.0
#include "servo_search.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dynid::detail {
namespace {

using Set = std::vector<int>;

constexpr int few = 4, many = 12;  // iterations of a fit that is compared, and of one that is kept
constexpr std::size_t kept_candidates = 4;

struct Trial {
  Set set;
  KnobFit fit;
  double evidence = 0.0;
};

bool has(const Set& set, int e) { return std::find(set.begin(), set.end(), e) != set.end(); }

class ServoSearch {
 public:
  ServoSearch(const ServoProblemOfJoint& p, const std::vector<std::string>& withhold,
              const ServoCriteria& criteria)
      : p_(p), criteria_(criteria) {
    const std::vector<ServoEffect>& all = servo_effects();
    for (int e = 0; e < static_cast<int>(all.size()); ++e) {
      const ServoEffect& effect = all[static_cast<std::size_t>(e)];
      const auto withheld = [&](const std::string& name) {
        return std::find(withhold.begin(), withhold.end(), name) != withhold.end();
      };
      bool out = withheld(effect.name) || !applies(effect, p.nominal, p.scale);
      for (const char* alias : effect.aliases) out = out || withheld(alias);
      if (!out) library_.push_back(e);
    }
    settle(p.nominal);
  }

  ServoChoice run() {
    Trial forward = grow({{}, fit({}, p_.nominal, many), 0.0});
    Trial whole = whole_servo(forward.fit.x);
    settle(whole.fit.loss < forward.fit.loss ? whole.fit.x : forward.fit.x);
    forward = shrink(refit(forward));
    whole = grow(shrink(refit(whole)));
    settle(whole.fit.loss < forward.fit.loss ? whole.fit.x : forward.fit.x);
    forward = refit(forward);
    whole = refit(whole);
    Trial best = whole.evidence > forward.evidence ? whole : forward;
    best = exchange(best);
    settle(best.fit.x);
    best = shrink(refit(best));
    return weigh(best);
  }

 private:
  /// Width of the loss and count of independent samples as the error of this model says.
  void settle(const Knobs& x) {
    width_ = servo_width(p_, x);
    samples_ = independent_samples(p_, x);
  }

  KnobFit fit(const Set& set, const Knobs& start, int iterations, RowSet rows = RowSet::fit) const {
    return fit_knobs(p_, start, freed(set), rows, width_, samples_, iterations);
  }

  double evidence(const Set& set, const KnobFit& f) const {
    KnobFit at_width = f;
    if (f.width != width_) at_width.loss = servo_loss(p_, f.x, RowSet::fit, width_);
    double out = log_evidence(p_, at_width, samples_);
    for (const int e : set) {
      if (!possible(servo_effects()[static_cast<std::size_t>(e)], f.x, p_.nominal, p_.scale))
        return -std::numeric_limits<double>::infinity();
      out -= price_of(e, samples_);
    }
    return out;
  }

  Trial refit(const Trial& t) const {
    Trial out{t.set, fit(t.set, t.fit.x, many), 0.0};
    out.evidence = evidence(out.set, out.fit);
    return out;
  }

  /// From `from`, with effect `e` in it: the best start, then a few steps.
  Trial with(const Trial& from, int e) const {
    Trial out{from.set, {}, 0.0};
    out.set.push_back(e);
    const std::vector<Knobs> starts =
        starts_of(servo_effects()[static_cast<std::size_t>(e)], from.fit.x, p_.scale);
    out.fit = fit_from(p_, starts, freed(out.set), RowSet::fit, width_, samples_, few);
    out.evidence = evidence(out.set, out.fit);
    return out;
  }

  Trial without(const Trial& from, int e) const {
    Trial out{from.set, {}, 0.0};
    out.set.erase(std::find(out.set.begin(), out.set.end(), e));
    Knobs x = from.fit.x;
    for (const Knob k : servo_effects()[static_cast<std::size_t>(e)].free) {
      const std::vector<Knob> still = freed(out.set);
      if (std::find(still.begin(), still.end(), k) == still.end()) x[at(k)] = p_.nominal[at(k)];
    }
    out.fit = fit(out.set, x, many);
    out.evidence = evidence(out.set, out.fit);
    return out;
  }

  std::vector<Trial> candidates(const Trial& from, const Set& among) const {
    std::vector<Trial> out(among.size());
    tbb::parallel_for(std::size_t{0}, among.size(), [&](std::size_t k) { out[k] = with(from, among[k]); });
    std::stable_sort(out.begin(), out.end(),
                     [](const Trial& a, const Trial& b) { return a.evidence > b.evidence; });
    const std::size_t keep = std::min(kept_candidates, out.size());
    tbb::parallel_for(std::size_t{0}, keep, [&](std::size_t k) { out[k] = refit(out[k]); });
    std::stable_sort(out.begin(), out.end(),
                     [](const Trial& a, const Trial& b) { return a.evidence > b.evidence; });
    return out;
  }

  Set others(const Set& set) const {
    Set out;
    for (const int e : library_)
      if (!has(set, e)) out.push_back(e);
    return out;
  }

  /// Fitted on each half, the loss on the other falls with the effect; the nominal's own changes, by which
  /// the smaller set may do as well, cost what they are unlikely.
  bool transfers(const Trial& less, const Trial& more) const {
    double before = 0.0, after = 0.0;
    bool worse = false;
    const auto cost = [&](const KnobFit& f, RowSet other) {
      return servo_loss(p_, f.x, other, width_) * (1.0 + 2.0 * f.penalty / samples_);
    };
    for (const auto& [half, other] : {std::pair{RowSet::first_half, RowSet::second_half},
                                      std::pair{RowSet::second_half, RowSet::first_half}}) {
      const double without = cost(fit(less.set, less.fit.x, few, half), other),
                   with = cost(fit(more.set, more.fit.x, few, half), other);
      before += without, after += with;
      worse = worse || with > without;
    }
    return !worse && after <= (1.0 - criteria_.least_gain) * before;
  }

  Trial grow(Trial best) {
    // What is put in may be taken out again, by another width of the loss: twice as often as there is room.
    for (int step = 0; step < 2 * criteria_.most_effects; ++step) {
      if (static_cast<int>(best.set.size()) >= criteria_.most_effects) break;
      std::vector<Trial> tried = candidates(best, others(best.set));
      if (tried.empty()) break;
      settle(tried.front().fit.x);
      best.evidence = evidence(best.set, best.fit);
      for (Trial& t : tried) t.evidence = evidence(t.set, t.fit);
      std::stable_sort(tried.begin(), tried.end(),
                       [](const Trial& a, const Trial& b) { return a.evidence > b.evidence; });
      if (best.set.empty() && alone_.empty()) remember(best, tried);
      bool grown = false;
      for (const Trial& t : tried) {
        if (t.evidence - best.evidence < criteria_.effect_gain) break;
        if (!transfers(best, t)) continue;
        best = refit(t);
        grown = true;
        break;
      }
      if (!grown) break;
      best = shrink(best);
    }
    return best;
  }

  /// Takes out what does not pay.
  Trial shrink(Trial best) const {
    while (!best.set.empty()) {
      std::vector<Trial> less(best.set.size());
      tbb::parallel_for(std::size_t{0}, best.set.size(),
                        [&](std::size_t k) { less[k] = without(best, best.set[k]); });
      std::size_t least = 0;
      for (std::size_t k = 1; k < less.size(); ++k)
        if (less[k].evidence > less[least].evidence) least = k;
      if (best.evidence - less[least].evidence >= criteria_.effect_gain && transfers(less[least], best))
        break;
      best = less[least];
    }
    return best;
  }

  /// All that a plain servo has, freed at once: where several are off, none explains much alone.
  Trial whole_servo(const Knobs& start) const {
    Trial out{{}, {}, 0.0};
    for (const int e : library_) {
      const std::vector<Knob>& k = servo_effects()[static_cast<std::size_t>(e)].free;
      if (k.size() != 1) continue;
      const bool plain = k.front() == Knob::damping || k.front() == Knob::coulomb ||
                         k.front() == Knob::inertia || k.front() == Knob::bias || k.front() == Knob::delay ||
                         (k.front() == Knob::limit && std::isfinite(p_.nominal[at(Knob::limit)])) ||
                         (k.front() == Knob::kp && p_.nominal[at(Knob::load_gain)] > 0.0);
      if (plain) out.set.push_back(e);
    }
    Knobs from = p_.nominal;  // and not what other effects have turned
    for (const Knob k : freed(out.set)) from[at(k)] = start[at(k)];
    std::vector<Knobs> starts = {p_.nominal, from};
    for (const double frequency : {0.3, 0.8}) {  // [rad] an interval
      Knobs x = p_.nominal;
      const double kp = x[at(Knob::kp)], w = frequency / p_.scale.interval;
      for (const int e : out.set) {
        const Knob k = servo_effects()[static_cast<std::size_t>(e)].free.front();
        if (k == Knob::inertia) x[at(k)] = kp / (w * w);
        if (k == Knob::damping) x[at(k)] = 2.0 * kp / w;
        if (k == Knob::coulomb) x[at(k)] = 0.05 * kp * p_.scale.error;
        if (k == Knob::delay) x[at(k)] = p_.scale.interval;
        if (k == Knob::limit) x[at(k)] = std::max(x[at(k)], 2.0 * kp * p_.scale.error);
      }
      starts.push_back(x);
    }
    std::vector<Trial> tried(starts.size(), out);
    tbb::parallel_for(std::size_t{0}, starts.size(),
                      [&](std::size_t k) { tried[k].fit = fit(out.set, starts[k], many); });
    std::size_t best = 0;
    for (std::size_t k = 1; k < tried.size(); ++k)
      if (tried[k].fit.loss < tried[best].fit.loss) best = k;
    tried[best].evidence = evidence(out.set, tried[best].fit);
    return tried[best];
  }

  /// Another in the place of one, where that explains more.
  Trial exchange(Trial best) const {
    constexpr int rounds = 3;
    for (int round = 0; round < rounds && !best.set.empty(); ++round) {
      Trial better = best;
      for (const int e : best.set) {
        const Trial less = without(best, e);
        Set among = others(best.set);
        if (among.empty()) continue;
        const std::vector<Trial> tried = candidates(less, among);
        if (tried.front().evidence > better.evidence + 1.0) better = tried.front();
      }
      // What two together imitate, one may be.
      for (std::size_t a = 0; a < best.set.size(); ++a)
        for (std::size_t b = a + 1; b < best.set.size(); ++b) {
          const Trial less = without(without(best, best.set[a]), best.set[b]);
          const Set among = others(best.set);
          if (among.empty()) continue;
          const std::vector<Trial> tried = candidates(less, among);
          if (tried.front().evidence > better.evidence) better = tried.front();
        }
      if (better.set == best.set) break;
      best = better;
    }
    return best;
  }

  ServoChoice weigh(const Trial& best) const {
    ServoChoice out;
    out.fit = best.fit;
    out.evidence = best.evidence;
    out.samples = samples_;
    out.alone = alone_;
    for (const int e : best.set) {
      WeighedServoEffect w;
      w.effect = e;
      const Trial less = without(best, e);
      w.gain = best.evidence - less.evidence;
      for (const Trial& t : candidates(less, others(best.set)))
        w.rivals.emplace_back(t.evidence - best.evidence,
                              servo_effects()[static_cast<std::size_t>(t.set.back())].name);
      out.effects.push_back(w);
    }
    return out;
  }

  void remember(const Trial& none, const std::vector<Trial>& tried) {
    const double before = servo_loss(p_, none.fit.x, RowSet::fit, width_);
    for (const Trial& t : tried) {
      const double after = servo_loss(p_, t.fit.x, RowSet::fit, width_);
      alone_.emplace_back(servo_effects()[static_cast<std::size_t>(t.set.back())].name,
                          before > 0.0 ? std::max(0.0, 1.0 - after / before) : 0.0);
    }
  }

  const ServoProblemOfJoint& p_;
  const ServoCriteria& criteria_;
  Set library_;
  double width_ = 0.0, samples_ = 3.0;
  std::vector<std::pair<std::string, double>> alone_;
};

}  // namespace

std::vector<Knob> freed(const std::vector<int>& effects) {
  std::vector<Knob> out;
  for (const int e : effects)
    for (const Knob k : servo_effects()[static_cast<std::size_t>(e)].free)
      if (std::find(out.begin(), out.end(), k) == out.end()) out.push_back(k);
  return out;
}

double price_of(int effect, double samples) {
  const std::size_t parameters = servo_effects()[static_cast<std::size_t>(effect)].free.size();
  return 0.5 * double(parameters) * std::log(samples) + std::log(double(servo_effects().size()));
}

ServoChoice no_servo_effect(const ServoProblemOfJoint& p) {
  ServoChoice out;
  out.samples = independent_samples(p, p.nominal);
  out.fit = fit_knobs(p, p.nominal, {}, RowSet::fit, servo_width(p, p.nominal), out.samples, few);
  out.evidence = log_evidence(p, out.fit, out.samples);
  return out;
}

ServoChoice search_servo(const ServoProblemOfJoint& p, const std::vector<std::string>& withhold,
                         const ServoCriteria& criteria) {
  return ServoSearch(p, withhold, criteria).run();
}

}  // namespace dynid::detail
