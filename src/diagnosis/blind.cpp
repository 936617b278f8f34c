// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/blind.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>

#include "diagnosis/stoppable_blind.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/diagnosis/calibration.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/family.hpp"
#include "dynid/simulation/measurement.hpp"
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

/// What a case is played on.
struct Stage {
  Robot robot;    ///< the true one, but for its effects and the spread of `nominal`
  Robot nominal;  ///< that the diagnosis is given
  FamilyRun run;
  bool family = false, vendor = false;
  std::vector<Effect> missing;  ///< of a vendor's model: friction and rotor inertia, as effects
};

BlindKind kind_of(const BlindOptions& options, int index) {
  constexpr BlindKind turns[] = {BlindKind::clean, BlindKind::nominal, BlindKind::weak};
  return options.kind == BlindKind::mixed ? turns[index % 3] : options.kind;
}

/// What a vendor's model lacks of the robot, as effects of all its joints.
std::vector<Effect> lacking(const Robot& robot) {
  std::vector<Effect> effects = {
      {"viscous_friction", {}, {}}, {"coulomb_friction", {}, {}}, {"rotor_inertia", {}, {}}};
  std::vector<double> viscous, coulomb, rotor;
  for (int j = 0; j < robot.size(); ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    viscous.push_back(joint.friction.linear.viscous);
    coulomb.push_back(joint.friction.linear.coulomb);
    rotor.push_back(joint.rotor_inertia);
    for (Effect& e : effects) e.joints.push_back(j + 1);
  }
  effects[0].parameters["coefficient"] = viscous;
  effects[1].parameters["coefficient"] = coulomb;
  effects[2].parameters["armature"] = rotor;
  effects.erase(std::remove_if(effects.begin(), effects.end(),
                               [](const Effect& e) {
                                 const std::vector<double>& x = e.parameters.begin()->second;
                                 return *std::max_element(x.begin(), x.end()) <= 0.0;
                               }),
                effects.end());
  return effects;
}

/// Drives with linear friction and rotors, in the robot's own sizes, where its model has none or another law.
void give_drives(Robot& robot, std::mt19937_64& random) {
  const std::vector<JointScale> scales = joint_scales(robot);
  const Eigen::VectorXd range = torque_ranges(robot);
  std::uniform_real_distribution<double> part(0.01, 0.04), rotor(0.1, 0.6);
  for (std::size_t j = 0; j < scales.size(); ++j) {
    Joint& joint = robot.joints[j];
    const double own = range[static_cast<Eigen::Index>(j)];
    joint.friction = {};
    joint.friction.linear.coulomb = part(random) * own;
    joint.friction.linear.viscous = part(random) * own / scales[j].speed;
    joint.friction.linear.velocity_scale = 2e-3 * scales[j].speed;
    joint.rotor_inertia = rotor(random) * scales[j].inertia;
  }
}

Stage stage_of(const Robot& nominal, const BlindOptions& options, int index, int attempt) {
  Stage stage;
  std::seed_seq sequence{options.seed, static_cast<unsigned long>(index), static_cast<unsigned long>(attempt),
                         0x7374616765UL};
  std::mt19937_64 random(sequence);
  stage.family = options.family;
  stage.vendor = kind_of(options, index) == BlindKind::vendor;
  stage.robot = nominal;
  stage.run.rate = options.rate;
  stage.run.duration = options.duration;
  if (options.family) {
    stage.robot = random_family_robot(random());
    stage.run = random_family_run(random());
  }
  if (stage.vendor && lacking(stage.robot).size() < 2) give_drives(stage.robot, random);
  stage.nominal = stage.robot;
  if (stage.vendor) {
    stage.nominal = as_a_vendor_says(stage.robot, index % 2 == 0 ? 0.05 : 0.10, random());
    stage.missing = lacking(stage.robot);
  }
  return stage;
}

Draw draw_case(const Stage& stage, const BlindOptions& options, int index, int attempt) {
  const Robot& robot = stage.robot;
  const double duration = stage.run.duration;
  std::seed_seq sequence{options.seed, static_cast<unsigned long>(index),
                         static_cast<unsigned long>(attempt)};
  std::mt19937_64 random(sequence);
  std::uniform_real_distribution<double> uniform;
  const double strength = kind_of(options, index) == BlindKind::weak ? 0.3 : 1.0;
  const auto& catalogue = effect_schemas();
  const auto any = [&] { return catalogue[random() % catalogue.size()].name; };
  const auto drawn = [&](const std::string& name) {
    const unsigned long seed = random();
    return stage.family ? draw_family_effect(name, robot, seed, strength, duration)
                        : draw_effect(name, robot, seed, strength, duration);
  };
  const auto add_another = [&](Draw& draw) {
    std::string name = any();
    while (std::any_of(draw.effects.begin(), draw.effects.end(),
                       [&](const Effect& e) { return e.name == name; }))
      name = any();
    draw.effects.push_back(drawn(name));
  };
  Draw draw;
  draw.seed = random();
  const double which = uniform(random);
  if (stage.vendor) {  // what it lacks is there anyhow
    if (which < 0.5) return draw;
    const auto within = [&](const char* name) {
      return std::any_of(stage.missing.begin(), stage.missing.end(),
                         [&](const Effect& e) { return e.name == name; });
    };
    do {
      draw.effects.clear();
      add_another(draw);
    } while (within(draw.effects[0].name.c_str()) || draw.effects[0].name == "link_inertial_error");
    return draw;
  }
  if (which < 0.12) return draw;  // no gap
  if (which < 0.19) {
    draw.unknown = unknown_kinds[random() % 3];
    const int n = robot.size(), count = 1 + static_cast<int>(random() % 2);
    for (int k = 0; k < count; ++k)
      draw.unknown_joints.push_back(static_cast<int>(random() % static_cast<unsigned long>(n)));
    draw.unknown_size = strength * (0.8 + 1.2 * uniform(random));
    draw.unknown_rate = 3.0 + 5.0 * uniform(random);
    if (stage.family) {  // of the largest joint of each type, so that it is seen on every one
      const std::vector<JointScale> scales = joint_scales(robot);
      draw.unknown_rate *= scales[static_cast<std::size_t>(draw.unknown_joints[0])].duration() > 0.0
                               ? 2.0 / scales[static_cast<std::size_t>(draw.unknown_joints[0])].duration()
                               : 1.0;
      draw.unknown_rate = std::min(draw.unknown_rate, 0.3 * stage.run.rate);
    }
    return draw;
  }
  if (which < 0.25) {
    draw.withheld = {without_twin[random() % std::size(without_twin)]};
    draw.effects.push_back(drawn(draw.withheld[0]));
    return draw;
  }
  const std::string first = any();
  draw.effects.push_back(drawn(first));
  if (which < 0.40) add_another(draw);
  if (stage.family && which < 0.58) {
    if (which >= 0.40) add_another(draw);
    if (which >= 0.46) add_another(draw);
  }
  return draw;
}

/// Torque of an effect that no library has: N x n.
Eigen::MatrixXd torque_of_unknown(const Stage& stage, const Draw& draw, const Log& log, unsigned long seed) {
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
  if (stage.family) {  // what was written for an arm of 57 N m, in multiples of the joint's own range
    const Eigen::VectorXd range = torque_ranges(stage.robot);
    for (Eigen::Index j = 0; j < tau.cols(); ++j) tau.col(j) *= range[j] / 57.0;
    if (draw.unknown == "unknown_product") {
      const std::vector<JointScale> scales = joint_scales(stage.robot);
      for (const int j : draw.unknown_joints)
        tau.col(j) *= 2.0 / scales[static_cast<std::size_t>((j + 2) % log.joints())].speed;
    }
  }
  return tau;
}

SimulateOptions plant_options(const Stage& stage, BlindKind kind, unsigned long seed) {
  SimulateOptions plant;
  plant.measurement = MeasurementOptions::realistic();
  plant.rate = stage.run.rate;
  plant.control_rate = stage.run.control_rate;
  plant.seed = seed;
  plant.record_torques = stage.family;
  if (kind == BlindKind::nominal || kind == BlindKind::vendor) {
    plant.spread = kind == BlindKind::vendor ? 0.0 : 0.02;  // a vendor's model has its own
  } else {
    plant.measurement.correlated_noise = 0.0;
    plant.measurement.stamp_jitter = 0.0;
    plant.measurement.repeat_probability = 0.0;
  }
  return plant;
}

/// The truth in the words of the diagnosis: a payload's centre of mass in the last link's frame.
nlohmann::json label_json(const Stage& stage, const Draw& draw, const std::vector<double>& shares) {
  const Robot& robot = stage.robot;
  nlohmann::json label = nlohmann::json::array();
  std::vector<Effect> all = draw.effects;
  all.insert(all.end(), stage.missing.begin(), stage.missing.end());
  for (Effect e : all) {
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
  for (std::size_t k = 0; k < label.size() && k < shares.size(); ++k) label[k]["share"] = shares[k];
  return label;
}

/// Energy that each effect of the case has in a log, joints scaled by their torque ranges.
void add_energies(const Stage& stage, const Draw& draw, const SimulatedRun& run,
                  std::vector<double>& energies) {
  const Eigen::VectorXd weight = torque_ranges(stage.robot).cwiseInverse();
  const auto n = static_cast<std::size_t>(stage.robot.size());
  energies.resize(draw.effects.size() + stage.missing.size(), 0.0);
  for (std::size_t k = 0; k < draw.effects.size(); ++k)
    energies[k] += (run.injected[k] * weight.asDiagonal()).squaredNorm();
  for (std::size_t m = 0; m < stage.missing.size(); ++m) {
    const Effect& e = stage.missing[m];
    const std::vector<double>& x = e.parameters.begin()->second;
    for (std::size_t j = 0; j < n; ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      const double width = std::max(stage.robot.joints[j].friction.linear.velocity_scale, 1e-12);
      Eigen::ArrayXd torque =
          e.name == "rotor_inertia" ? run.seen_ddq.col(column).array() : run.seen_dq.col(column).array();
      if (e.name == "coulomb_friction") torque = (torque / width).tanh();
      energies[draw.effects.size() + m] += (x[j] * weight[column] * torque).square().sum();
    }
  }
}

/// The logs of a case: one robot, two motions (in the family one or two). Returns the effects' shares.
std::vector<double> record(const Stage& stage, BlindKind kind, const Draw& draw, const std::string& folder) {
  std::filesystem::create_directories(folder);
  std::vector<double> energies;
  for (int l = 0; l < stage.run.logs; ++l) {
    const unsigned long seed = draw.seed + static_cast<unsigned long>(l);
    SimulateOptions plant = plant_options(stage, kind, seed);
    const Robot robot = perturbed(stage.robot, plant.spread, draw.seed);
    plant.spread = 0.0;
    const Trajectory motion = stage.family ? family_motion(stage.robot, stage.run, seed)
                                           : random_motion(stage.robot, stage.run.duration, seed);
    SimulatedRun run = simulate(robot, draw.effects, motion, plant);
    if (plant.record_torques) add_energies(stage, draw, run, energies);
    if (!draw.unknown.empty()) run.log.tau += torque_of_unknown(stage, draw, run.log, seed);
    write_log(folder + (l == 0 ? "/log_a.csv" : "/log_b.csv"), run.log);
  }
  double sum = 0.0;
  for (const double e : energies) sum += e;
  for (double& e : energies) e = sum > 0.0 ? e / sum : 0.0;
  return energies;
}

const char* name_of(FamilyMotion motion) {
  return motion == FamilyMotion::exciting ? "exciting"
         : motion == FamilyMotion::slow   ? "slow"
                                          : "pick_and_place";
}

/// The library without the effects that were put in; nothing where they are not all of it.
std::vector<std::string> all_but(const Stage& stage, const Draw& draw) {
  std::vector<std::string> others;
  if (draw.effects.empty() || !draw.withheld.empty() || stage.vendor) return others;
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
  return run_blind(nominal, options, nullptr);
}

std::vector<BlindCase> run_blind(const Robot& nominal, const BlindOptions& options,
                                 const std::atomic<bool>* stop) {
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
    if (stop != nullptr && *stop) return;
    BlindCase& here = cases[k];
    const std::string name = case_name(static_cast<int>(k));
    const fs::path folder = logs / name;
    try {
      std::vector<std::string> withhold, others;
      Robot model;
      int logs_of_case = 0;
      for (int attempt = 0; attempt < draws_of_a_case; ++attempt) {
        try {
          // The draw is forgotten before the diagnosis begins; the label goes to the sealed folder.
          const Stage stage = stage_of(nominal, options, static_cast<int>(k), attempt);
          const Draw draw = draw_case(stage, options, static_cast<int>(k), attempt);
          const std::vector<double> shares =
              record(stage, kind_of(options, static_cast<int>(k)), draw, folder.string());
          write_file((sealed / (name + ".json")).string(), label_json(stage, draw, shares).dump(1) + "\n");
          withhold = draw.withheld;
          others = all_but(stage, draw);
          model = stage.nominal;
          logs_of_case = stage.run.logs;
          here.vendor = stage.vendor;
          if (stage.vendor) here.background = {"link_inertial_error"};
          if (stage.family)
            here.drawn = {{"robot", stage.robot.name},
                          {"joints", std::to_string(stage.robot.size())},
                          {"motion", name_of(stage.run.motion)},
                          {"rate", std::to_string(stage.run.rate)},
                          {"duration", std::to_string(stage.run.duration)},
                          {"logs", std::to_string(stage.run.logs)}};
          break;
        } catch (const Error&) {
          if (attempt + 1 == draws_of_a_case) throw;
        }
      }
      DiagnoseOptions diagnose_options = options.diagnose;
      diagnose_options.withhold.insert(diagnose_options.withhold.end(), withhold.begin(), withhold.end());
      diagnose_options.progress = nullptr;
      diagnose_options.replay = false;
      std::vector<Log> pair = {read_log((folder / "log_a.csv").string(), model.size())};
      if (logs_of_case > 1) pair.push_back(read_log((folder / "log_b.csv").string(), model.size()));
      const Diagnosis d = diagnose(model, pair, diagnose_options);
      here.withheld = withhold;
      here.verdict = d.verdict;
      here.p_value = d.p_value;
      here.explained = d.explained;
      here.found = d.effects;
      here.considered = d.considered;
      for (const RankedEffect& r : d.ranking) here.ranking.emplace_back(r.name, r.probability);
      here.shrink = d.shrink.fraction;
      here.nominal_error = d.nominal_error;
      here.seconds = d.seconds;
      if (!others.empty()) {  // what could have been had, now that the diagnosis is done
        diagnose_options.withhold = others;
        here.true_shrink = diagnose(model, pair, diagnose_options).shrink.fraction;
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
    for (const nlohmann::json& e : nlohmann::json::parse(read_file(path))) {
      cases[k].truth.push_back({e["name"], e["joints"], e["parameters"]});
      cases[k].truth_shares.push_back(e.value("share", 0.0));
    }
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
    if (p.key == "velocity_scale" && p.per_joint) continue;  // smooths a sign: nothing that a joint has
    const auto found = e.parameters.find(p.key);
    if (found == e.parameters.end() || found->second.size() != static_cast<std::size_t>(p.value.size()))
      continue;
    for (Eigen::Index i = 0; i < p.value.size(); ++i) {
      if (p.low[i] == p.high[i]) continue;  // chosen, not measured
      double truth = found->second[static_cast<std::size_t>(i)];
      if (e.name == "gravity_tilt") truth = turned_positive(e, p.key, p.value[i]);
      if (p.key == "phase") truth = turned_to(p.value[i], truth, 2.0 * M_PI);
      const int joint = static_cast<int>(i) + 1;
      if (truth == 0.0 || (p.per_joint && !(has(e.joints, joint) && has(first.effect.joints, joint))))
        continue;
      out.push_back({p.key, p.value[i], p.low[i], p.high[i], truth, Calibration::scale(p, i)});
    }
  }
  return out;
}

namespace {

bool names(const BlindCase& c, const std::string& name) {
  return std::any_of(c.found.begin(), c.found.end(),
                     [&](const FoundEffect& f) { return f.effect.name == name; });
}

bool is_there(const BlindCase& c, const std::string& name) {
  return std::any_of(c.truth.begin(), c.truth.end(), [&](const Effect& e) { return e.name == name; }) ||
         std::find(c.background.begin(), c.background.end(), name) != c.background.end();
}

/// Counts every effect named; whether one was at 0.9 or more.
bool score_all_named(const BlindCase& c, BlindScore& s, std::vector<double>& sums,
                     std::vector<double>& right) {
  bool confident = false;
  for (const FoundEffect& f : c.found) {
    const bool there = is_there(c, f.effect.name);
    ++s.named;
    const auto bin = static_cast<std::size_t>(std::clamp(f.probability * 10.0, 0.0, 9.0));
    sums[bin] += f.probability;
    right[bin] += there ? 1.0 : 0.0;
    if (f.probability >= 0.9) {
      confident = true;
      ++s.named_confident;
      if (!there) ++s.confident_not_there;
    } else if (f.probability >= 0.5) {
      ++s.named_likely;
      s.likely_claimed += f.probability;
      if (!there) ++s.likely_not_there;
    }
  }
  return confident;
}

void score_vendor(const BlindCase& c, BlindScore& s, std::vector<double>& friction_errors) {
  for (std::size_t k = 0; k < c.truth.size(); ++k) {
    const Effect& e = c.truth[k];
    const bool friction = e.name == "viscous_friction" || e.name == "coulomb_friction";
    const bool main = friction || e.name == "rotor_inertia";
    if (k < c.truth_shares.size() && c.truth_shares[k] >= (main ? 0.02 : 0.03)) {
      ++(main ? s.vendor_main : s.vendor_further);
      if (names(c, e.name)) ++(main ? s.vendor_main_named : s.vendor_further_named);
    }
    if (!friction) continue;
    for (const FoundEffect& f : c.found) {
      const auto found = f.effect.parameters.find("coefficient");
      if (f.effect.name != e.name || found == f.effect.parameters.end()) continue;
      const std::vector<double>& truth = e.parameters.at("coefficient");
      for (const int joint : f.effect.joints) {
        const auto j = static_cast<std::size_t>(joint - 1);
        if (j < truth.size() && j < found->second.size() && truth[j] > 0.0)
          friction_errors.push_back(std::abs(found->second[j] / truth[j] - 1.0));
      }
    }
  }
}

}  // namespace

std::map<std::string, double> further_figures(const BlindScore& s) {
  return {{"named", s.named},
          {"named_confident", s.named_confident},
          {"confident_not_there", s.confident_not_there},
          {"named_likely", s.named_likely},
          {"likely_not_there", s.likely_not_there},
          {"likely_claimed", s.likely_claimed},
          {"calibration_error_all", s.calibration_error_all},
          {"clean_verdicts", s.clean_verdicts},
          {"healthy_confident", s.healthy_confident},
          {"unknown_confident", s.unknown_confident},
          {"triples", s.triples},
          {"all_three_found", s.all_three_found},
          {"known_unexplained", s.known_unexplained},
          {"vendor_main", s.vendor_main},
          {"vendor_main_named", s.vendor_main_named},
          {"vendor_further", s.vendor_further},
          {"vendor_further_named", s.vendor_further_named},
          {"vendor_friction_error", s.vendor_friction_error}};
}

BlindScore score(const std::vector<BlindCase>& cases) {
  BlindScore s;
  std::vector<double> errors, shrinks, ratios, friction_errors;
  std::vector<double> bin_sum(10, 0.0), bin_right(10, 0.0), all_sum(10, 0.0), all_right(10, 0.0);
  int judged = 0;
  for (const BlindCase& c : cases) {
    if (!c.failure.empty()) {
      ++s.failures;
      continue;
    }
    ++s.cases;
    const bool confident = score_all_named(c, s, all_sum, all_right);
    if (c.vendor) score_vendor(c, s, friction_errors);
    const FoundEffect* first = c.found.empty() ? nullptr : &c.found.front();
    const std::string named = first == nullptr ? to_string(c.verdict) : first->effect.name;
    if (c.truth.empty()) {
      ++s.no_gap;
      if (c.verdict == Verdict::no_gap || c.verdict == Verdict::not_detected) ++s.clean_verdicts;
      if (confident) ++s.healthy_confident;
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
      if (confident) ++s.unknown_confident;
      ++s.confusion["(" + (c.withheld.empty() ? c.truth[0].name : "withheld " + c.truth[0].name) + ")"]
                   [named];
      if (c.verdict == Verdict::unexplained) ++s.abstained;
      if (first != nullptr && first->probability >= 0.9) ++s.confident_wrong;
      continue;
    }
    ++s.known;
    if (c.verdict == Verdict::unexplained) ++s.known_unexplained;
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
    if (c.truth.size() > 1 && !c.vendor) {
      std::size_t found = 0;
      for (const Effect& e : c.truth) found += names(c, e.name) ? 1 : 0;
      (c.truth.size() == 2 ? s.pairs : s.triples) += 1;
      if (found == c.truth.size()) ++(c.truth.size() == 2 ? s.both_found : s.all_three_found);
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
  s.parameter_error = median(errors);
  s.shrink = median(shrinks);
  s.shrink_of_true = median(ratios);
  s.vendor_friction_error = median(friction_errors);
  for (std::size_t b = 0; b < 10; ++b)
    if (s.named > 0) s.calibration_error_all += std::abs(all_right[b] - all_sum[b]) / s.named;
  for (std::size_t b = 0; b < 10; ++b)
    if (judged > 0) s.calibration_error += std::abs(bin_right[b] - bin_sum[b]) / judged;
  return s;
}

}  // namespace dynid
