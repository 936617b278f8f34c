// SPDX-License-Identifier: Apache-2.0
#include "blind_case.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>

#include "alike.hpp"
#include "dynid/base/error.hpp"
#include "dynid/diagnosis/hypothesis.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/measurement.hpp"
#include "dynid/simulation/perturbed.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/simulate.hpp"

namespace dynid::detail {
namespace {

// Effects that nothing else of the catalogue can stand in for, alone or with another: taken out of the
// library, they are unknown.
constexpr const char* without_twin[] = {"gravity_tilt", "torque_ripple", "torque_saturation", "time_delay",
                                        "external_contact"};
constexpr const char* unknown_kinds[] = {"unknown_periodic", "unknown_product", "unknown_wander"};

}  // namespace

BlindKind kind_of(const BlindOptions& options, int index) {
  constexpr BlindKind turns[] = {BlindKind::clean, BlindKind::nominal, BlindKind::weak};
  return options.kind == BlindKind::mixed ? turns[index % 3] : options.kind;
}

namespace {

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

}  // namespace

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
    const unsigned long seed = random();
    if (!options.given_robot) stage.robot = random_family_robot(seed);
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

namespace {

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

}  // namespace

nlohmann::json label_json(const Stage& stage, const Draw& draw, const Recorded& recorded, double tolerance) {
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
  for (std::size_t k = 0; k < label.size() && k < recorded.shares.size(); ++k)
    label[k]["share"] = recorded.shares[k];
  if (stage.family)
    for (nlohmann::json& e : label) e["within_tolerance"] = recorded.size <= tolerance;
  return label;
}

namespace {

/// Energy that each effect of the case has in a log, joints scaled by their torque ranges. Returns the torque
/// of all of them.
Eigen::MatrixXd add_energies(const Stage& stage, const Draw& draw, const SimulatedRun& run,
                             std::vector<double>& energies) {
  const Eigen::VectorXd weight = torque_ranges(stage.robot).cwiseInverse();
  const auto n = static_cast<std::size_t>(stage.robot.size());
  energies.resize(draw.effects.size() + stage.missing.size(), 0.0);
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(run.seen_dq.rows(), run.seen_dq.cols());
  for (std::size_t k = 0; k < draw.effects.size(); ++k) {
    energies[k] += (run.injected[k] * weight.asDiagonal()).squaredNorm();
    all += run.injected[k];
  }
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
      all.col(column).array() += x[j] * torque;
    }
  }
  return all;
}

}  // namespace

Recorded record(const Stage& stage, BlindKind kind, const Draw& draw, const std::string& folder) {
  std::filesystem::create_directories(folder);
  std::vector<double> energies;
  Eigen::RowVectorXd gap = Eigen::RowVectorXd::Zero(stage.robot.size()), carried = gap;
  for (int l = 0; l < stage.run.logs; ++l) {
    const unsigned long seed = draw.seed + static_cast<unsigned long>(l);
    SimulateOptions plant = plant_options(stage, kind, seed);
    const Robot robot = perturbed(stage.robot, plant.spread, draw.seed);
    plant.spread = 0.0;
    const Trajectory motion = stage.family ? family_motion(stage.robot, stage.run, seed)
                                           : random_motion(stage.robot, stage.run.duration, seed);
    SimulatedRun run = simulate(robot, draw.effects, motion, plant);
    if (plant.record_torques) gap += add_energies(stage, draw, run, energies).colwise().squaredNorm();
    carried += run.log.tau.colwise().squaredNorm();
    if (!draw.unknown.empty()) {
      const Eigen::MatrixXd unknown = torque_of_unknown(stage, draw, run.log, seed);
      gap += unknown.colwise().squaredNorm();
      run.log.tau += unknown;
    }
    write_log(folder + (l == 0 ? "/log_a.csv" : "/log_b.csv"), run.log);
  }
  double sum = 0.0;
  for (const double e : energies) sum += e;
  for (double& e : energies) e = sum > 0.0 ? e / sum : 0.0;
  // What a joint carries at least, as the diagnosis has it.
  const Eigen::VectorXd load = carried.cwiseSqrt().transpose(),
                        floor = Criteria().least_load * largest_alike(stage.robot, load);
  const double size =
      stage.family ? (gap.transpose().array().sqrt() / load.cwiseMax(floor).array().max(1e-300)).maxCoeff()
                   : 0.0;
  return {energies, size};
}

namespace {

const char* name_of(FamilyMotion motion) {
  return motion == FamilyMotion::exciting ? "exciting"
         : motion == FamilyMotion::slow   ? "slow"
                                          : "pick_and_place";
}

}  // namespace

std::vector<std::string> all_but(const Stage& stage, const Draw& draw) {
  std::vector<std::string> others;
  if (draw.effects.empty() || !draw.withheld.empty() || stage.vendor) return others;
  for (const auto& h : hypotheses())
    if (std::none_of(draw.effects.begin(), draw.effects.end(),
                     [&](const Effect& e) { return e.name == h->name(); }))
      others.push_back(h->name());
  return others;
}

std::map<std::string, std::string> drawn(const Stage& stage) {
  if (!stage.family) return {};
  return {{"robot", stage.robot.name},
          {"joints", std::to_string(stage.robot.size())},
          {"motion", name_of(stage.run.motion)},
          {"rate", std::to_string(stage.run.rate)},
          {"duration", std::to_string(stage.run.duration)},
          {"logs", std::to_string(stage.run.logs)}};
}

void set_answer(const Diagnosis& diagnosis, BlindCase& out) {
  out.verdict = diagnosis.verdict;
  out.p_value = diagnosis.p_value;
  out.explained = diagnosis.explained;
  out.found = diagnosis.effects;
  out.considered = diagnosis.considered;
  for (const RankedEffect& r : diagnosis.ranking) out.ranking.emplace_back(r.name, r.probability);
  out.shrink = diagnosis.shrink.fraction;
  out.nominal_error = diagnosis.nominal_error;
  out.seconds = diagnosis.seconds;
}

}  // namespace dynid::detail
