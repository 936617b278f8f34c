// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/blind.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/diagnosis/calibration.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/perturbed.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid {
namespace {

constexpr int draws_of_a_case = 8;  // a robot may run away from its motion: then another is drawn

// Effects that nothing else of the catalogue can stand in for, alone or with another: taken out of the
// library, they are unknown.
constexpr const char* without_twin[] = {"gravity_tilt", "torque_ripple", "torque_saturation", "time_delay",
                                        "external_contact"};
constexpr const char* unknown_kinds[] = {"unknown_periodic", "unknown_product", "unknown_wander"};

/// What the robot is given in one case.
struct Draw {
  std::vector<Effect> effects;  // known to the plant
  std::string unknown;          // or made by torque_of_unknown()
  std::vector<std::string> withheld;
  std::vector<int> unknown_joints;
  double unknown_size = 0.0, unknown_rate = 0.0;
  unsigned long seed = 0;
};

BlindKind kind_of(const BlindOptions& options, int index) {
  constexpr BlindKind turns[] = {BlindKind::clean, BlindKind::nominal, BlindKind::weak};
  return options.kind == BlindKind::mixed ? turns[index % 3] : options.kind;
}

Draw draw_case(const Robot& robot, const BlindOptions& options, int index, int attempt) {
  std::seed_seq sequence{options.seed, static_cast<unsigned long>(index),
                         static_cast<unsigned long>(attempt)};
  std::mt19937_64 random(sequence);
  std::uniform_real_distribution<double> uniform;
  const double strength = kind_of(options, index) == BlindKind::weak ? 0.3 : 1.0;
  const auto& catalogue = simulation_effects();
  const auto any = [&] { return catalogue[random() % catalogue.size()].name; };
  Draw draw;
  draw.seed = random();
  const double which = uniform(random);
  if (which < 0.12) return draw;  // no gap
  if (which < 0.19) {
    draw.unknown = unknown_kinds[random() % 3];
    const int n = robot.size(), count = 1 + static_cast<int>(random() % 2);
    for (int k = 0; k < count; ++k)
      draw.unknown_joints.push_back(static_cast<int>(random() % static_cast<unsigned long>(n)));
    draw.unknown_size = strength * (0.8 + 1.2 * uniform(random));
    draw.unknown_rate = 3.0 + 5.0 * uniform(random);
    return draw;
  }
  if (which < 0.25) {
    draw.withheld = {without_twin[random() % std::size(without_twin)]};
    draw.effects.push_back(draw_effect(draw.withheld[0], robot, random(), strength, options.duration));
    return draw;
  }
  const std::string first = any();
  draw.effects.push_back(draw_effect(first, robot, random(), strength, options.duration));
  if (which < 0.40) {
    std::string second = any();
    while (second == first) second = any();
    draw.effects.push_back(draw_effect(second, robot, random(), strength, options.duration));
  }
  return draw;
}

/// Torque of an effect that no library has: N x n.
Eigen::MatrixXd torque_of_unknown(const Draw& draw, const Log& log, unsigned long seed) {
  Eigen::MatrixXd tau = Eigen::MatrixXd::Zero(log.samples(), log.joints());
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (const int j : draw.unknown_joints) {
    if (draw.unknown == "unknown_periodic") {  // time, not motion, drives it
      tau.col(j) = draw.unknown_size * (draw.unknown_rate * log.t.array()).sin();
    } else if (draw.unknown == "unknown_product") {  // two joints' positions and speeds together
      const int other = (j + 3) % log.joints();
      tau.col(j) = 2.0 * draw.unknown_size * (2.0 * log.q.col(other).array()).sin() *
                   log.dq.col((j + 2) % log.joints()).array();
    } else {
      double x = 0.0, smooth = 0.0;
      for (Eigen::Index i = 1; i < log.samples(); ++i) {
        const double dt = log.t[i] - log.t[i - 1];
        x += -x * dt / 0.5 + normal(random) * std::sqrt(2.0 * dt / 0.5);
        smooth += (x - smooth) * std::min(1.0, dt / 0.1);
        tau(i, j) = draw.unknown_size * smooth;
      }
    }
  }
  return tau;
}

SimulateOptions plant_options(const BlindOptions& options, BlindKind kind, unsigned long seed) {
  SimulateOptions plant;
  plant.measurement = MeasurementOptions::realistic();
  plant.rate = options.rate;
  plant.seed = seed;
  plant.record_torques = false;
  if (kind == BlindKind::nominal) {
    plant.spread = 0.02;
  } else {
    plant.measurement.correlated_noise = 0.0;
    plant.measurement.stamp_jitter = 0.0;
    plant.measurement.repeat_probability = 0.0;
  }
  return plant;
}

/// The truth in the words of the diagnosis: a payload's centre of mass in the last link's frame.
nlohmann::json label_json(const Robot& robot, const Draw& draw) {
  nlohmann::json label = nlohmann::json::array();
  for (Effect e : draw.effects) {
    if (e.name == "payload") {
      std::vector<double>& com = e.parameters.at("com");
      const Eigen::Vector3d there = robot.tip * Eigen::Vector3d(com[0], com[1], com[2]);
      com.assign(there.begin(), there.end());
    }
    label.push_back({{"name", e.name}, {"joints", e.joints}, {"parameters", e.parameters}});
  }
  if (!draw.unknown.empty()) {
    std::vector<int> joints = draw.unknown_joints;
    for (int& j : joints) ++j;
    std::sort(joints.begin(), joints.end());
    joints.erase(std::unique(joints.begin(), joints.end()), joints.end());
    label.push_back({{"name", draw.unknown}, {"joints", joints}, {"parameters", nlohmann::json::object()}});
  }
  return label;
}

/// The two logs of a case: one robot, two motions.
void record(const Robot& nominal, const BlindOptions& options, BlindKind kind, const Draw& draw,
            const std::string& folder) {
  std::filesystem::create_directories(folder);
  for (int l = 0; l < 2; ++l) {
    const unsigned long seed = draw.seed + static_cast<unsigned long>(l);
    SimulateOptions plant = plant_options(options, kind, seed);
    const Robot robot = perturbed(nominal, plant.spread, draw.seed);
    plant.spread = 0.0;
    SimulatedRun run = simulate(robot, draw.effects, random_motion(nominal, options.duration, seed), plant);
    if (!draw.unknown.empty()) run.log.tau += torque_of_unknown(draw, run.log, seed);
    write_log(folder + (l == 0 ? "/log_a.csv" : "/log_b.csv"), run.log);
  }
}

/// The library without the effects that were put in; nothing where they are not all of it.
std::vector<std::string> all_but(const Draw& draw) {
  std::vector<std::string> others;
  if (draw.effects.empty() || !draw.withheld.empty()) return others;
  for (const auto& h : hypotheses())
    if (std::none_of(draw.effects.begin(), draw.effects.end(),
                     [&](const Effect& e) { return e.name == h->name(); }))
      others.push_back(h->name());
  return others;
}

std::string case_name(int index) {
  std::string digits = std::to_string(index);
  return "case_" + std::string(digits.size() < 5 ? 5 - digits.size() : 0, '0') + digits;
}

}  // namespace

std::vector<BlindCase> run_blind(const Robot& nominal, const BlindOptions& options) {
  namespace fs = std::filesystem;
  const fs::path logs = fs::path(options.folder) / "logs", sealed = fs::path(options.folder) / "sealed";
  std::error_code error;
  fs::create_directories(logs, error);
  if (!error) fs::create_directories(sealed, error);
  if (error) throw Error(options.folder + ": cannot be made: " + error.message());
  const auto count = static_cast<std::size_t>(options.cases);
  std::vector<BlindCase> cases(count);
  std::mutex mutex;
  int done = 0;
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t k) {
    BlindCase& here = cases[k];
    const std::string name = case_name(static_cast<int>(k));
    const fs::path folder = logs / name;
    try {
      std::vector<std::string> withhold, others;
      for (int attempt = 0; attempt < draws_of_a_case; ++attempt) {
        try {
          // The draw is forgotten before the diagnosis begins; the label goes to the sealed folder.
          const Draw draw = draw_case(nominal, options, static_cast<int>(k), attempt);
          record(nominal, options, kind_of(options, static_cast<int>(k)), draw, folder.string());
          write_file((sealed / (name + ".json")).string(), label_json(nominal, draw).dump(1) + "\n");
          withhold = draw.withheld;
          others = all_but(draw);
          break;
        } catch (const Error&) {
          if (attempt + 1 == draws_of_a_case) throw;
        }
      }
      DiagnoseOptions diagnose_options = options.diagnose;
      diagnose_options.withhold.insert(diagnose_options.withhold.end(), withhold.begin(), withhold.end());
      diagnose_options.progress = nullptr;
      diagnose_options.replay = false;
      const std::vector<Log> pair = {read_log((folder / "log_a.csv").string(), nominal.size()),
                                     read_log((folder / "log_b.csv").string(), nominal.size())};
      const Diagnosis d = diagnose(nominal, pair, diagnose_options);
      here.withheld = withhold;
      here.verdict = d.verdict;
      here.p_value = d.p_value;
      here.explained = d.explained;
      here.found = d.effects;
      for (const RankedEffect& r : d.ranking) here.ranking.emplace_back(r.name, r.probability);
      here.shrink = d.shrink.fraction;
      here.nominal_error = d.nominal_error;
      here.seconds = d.seconds;
      if (!others.empty()) {  // what could have been had, now that the diagnosis is done
        diagnose_options.withhold = others;
        here.true_shrink = diagnose(nominal, pair, diagnose_options).shrink.fraction;
      }
    } catch (const std::exception& failure) {
      here.failure = failure.what();
    }
    const std::lock_guard<std::mutex> lock(mutex);
    ++done;
    if (options.progress) options.progress(done, options.cases);
  });
  // Only now are the labels opened.
  for (std::size_t k = 0; k < count; ++k) {
    const std::string path = (sealed / (case_name(static_cast<int>(k)) + ".json")).string();
    if (!fs::exists(path)) continue;
    for (const nlohmann::json& e : nlohmann::json::parse(read_file(path)))
      cases[k].truth.push_back({e["name"], e["joints"], e["parameters"]});
  }
  return cases;
}

namespace {

/// The same angle, less than half a turn from `there`.
double turned_to(double there, double angle, double turn) {
  return angle + turn * std::round((there - angle) / turn);
}

/// A tilt by -a towards d is one by a towards d + 180: the truth in the words of the estimate.
double turned_positive(const Effect& tilt, const std::string& key, double estimate) {
  const double angle = tilt.parameters.at("angle_deg")[0];
  if (key == "angle_deg") return std::abs(angle);
  const double direction = tilt.parameters.at("direction_deg")[0] + (angle < 0.0 ? 180.0 : 0.0);
  return turned_to(estimate, direction, 360.0);
}

}  // namespace

std::vector<ComparedInterval> compared_intervals(const BlindCase& c) {
  std::vector<ComparedInterval> out;
  if (c.truth.size() != 1 || c.found.empty() || c.found.front().effect.name != c.truth.front().name ||
      !c.withheld.empty())
    return out;
  const Effect& e = c.truth.front();
  const FoundEffect& first = c.found.front();
  const auto has = [](const std::vector<int>& joints, int joint) {
    return std::find(joints.begin(), joints.end(), joint) != joints.end();
  };
  const auto link = first.effect.parameters.find("link"), true_link = e.parameters.find("link");
  if (link != first.effect.parameters.end() && true_link != e.parameters.end() &&
      link->second != true_link->second)
    return out;  // what belongs to another link is in another frame
  for (const Estimate& p : first.parameters) {
    const auto found = e.parameters.find(p.key);
    if (found == e.parameters.end() || found->second.size() != static_cast<std::size_t>(p.value.size()))
      continue;
    for (Eigen::Index i = 0; i < p.value.size(); ++i) {
      if (p.low[i] == p.high[i]) continue;  // chosen, not measured
      double truth = found->second[static_cast<std::size_t>(i)];
      if (e.name == "gravity_tilt") truth = turned_positive(e, p.key, p.value[i]);
      if (p.key == "phase") truth = turned_to(p.value[i], truth, 2.0 * M_PI);
      const int joint = static_cast<int>(i) + 1;
      const bool per_joint = p.value.size() >= 4;
      if (truth == 0.0 || (per_joint && !(has(e.joints, joint) && has(first.effect.joints, joint)))) continue;
      out.push_back({p.key, p.value[i], p.low[i], p.high[i], truth, Calibration::scale(p, i)});
    }
  }
  return out;
}

BlindScore score(const std::vector<BlindCase>& cases) {
  BlindScore s;
  std::vector<double> errors, shrinks, ratios;
  std::vector<double> bin_sum(10, 0.0), bin_right(10, 0.0);
  int judged = 0;
  for (const BlindCase& c : cases) {
    if (!c.failure.empty()) {
      ++s.failures;
      continue;
    }
    ++s.cases;
    const FoundEffect* first = c.found.empty() ? nullptr : &c.found.front();
    const std::string named = first == nullptr ? to_string(c.verdict) : first->effect.name;
    if (c.truth.empty()) {
      ++s.no_gap;
      ++s.confusion["(no gap)"][named];
      if (first != nullptr) {
        ++s.false_alarms;
        if (first->probability >= 0.9) ++s.confident_wrong;
      }
      continue;
    }
    const bool beyond = c.truth[0].name.rfind("unknown", 0) == 0 || !c.withheld.empty();
    if (beyond) {
      ++s.unknown;
      ++s.confusion["(" + (c.withheld.empty() ? c.truth[0].name : "withheld " + c.truth[0].name) + ")"]
                   [named];
      if (c.verdict == Verdict::unexplained) ++s.abstained;
      if (first != nullptr && first->probability >= 0.9) ++s.confident_wrong;
      continue;
    }
    ++s.known;
    const auto is_true = [&](const std::string& name) {
      return std::any_of(c.truth.begin(), c.truth.end(), [&](const Effect& e) { return e.name == name; });
    };
    std::string truth = c.truth[0].name;
    if (first != nullptr && is_true(named)) truth = named;
    ++s.confusion[truth][named];
    const bool right = first != nullptr && is_true(named);
    bool in_class = right;
    if (first != nullptr)
      for (const std::string& alias : first->aliases) in_class = in_class || is_true(alias);
    s.first_right += right ? 1 : 0;
    s.class_right += in_class ? 1 : 0;
    if (c.truth.size() > 1) {
      ++s.pairs;
      int found = 0;
      for (const Effect& e : c.truth)
        found += std::any_of(c.found.begin(), c.found.end(),
                             [&](const FoundEffect& f) { return f.effect.name == e.name; })
                     ? 1
                     : 0;
      if (found == 2) ++s.both_found;
    }
    if (first != nullptr) {
      ++judged;
      const auto bin = static_cast<std::size_t>(std::clamp(first->probability * 10.0, 0.0, 9.0));
      bin_sum[bin] += first->probability;
      bin_right[bin] += right ? 1.0 : 0.0;
      if (!right && first->probability >= 0.9) ++s.confident_wrong;
    }
    if (right && c.truth.size() == 1 && c.truth.front().joints == first->effect.joints) ++s.joints_right;
    for (const ComparedInterval& i : compared_intervals(c)) {
      ++s.intervals;
      if (i.low <= i.truth && i.truth <= i.high) ++s.covered;
      errors.push_back(std::abs(i.value - i.truth) / std::abs(i.truth));
    }
    if (c.true_shrink > 0.2) ratios.push_back(std::max(0.0, c.shrink) / c.true_shrink);
    shrinks.push_back(c.shrink);
  }
  const auto middle = [](std::vector<double> x) {
    if (x.empty()) return 0.0;
    std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
    return x[x.size() / 2];
  };
  s.parameter_error = middle(errors);
  s.shrink = middle(shrinks);
  s.shrink_of_true = middle(ratios);
  for (std::size_t b = 0; b < 10; ++b)
    if (judged > 0) s.calibration_error += std::abs(bin_right[b] - bin_sum[b]) / judged;
  return s;
}

}  // namespace dynid
