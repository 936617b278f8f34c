// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/servo_blind.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>

#include "blind_case.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/diagnosis/servo_diagnose.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/identification/servo.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/family.hpp"
#include "dynid/simulation/random_motion.hpp"
#include "dynid/simulation/servo_plant.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

constexpr int draws_of_a_case = 8;  // an arm may leave its commands: then another is drawn
constexpr double sharp = 1e-4;  // width of a sign, of the joint's speed: a joint that holds does not creep
constexpr const char* drawn_effects[] = {"servo_stiffness", "servo_damping",     "command_delay",
                                         "command_filter",  "coulomb_friction",  "rotor_inertia",
                                         "encoder_offset",  "backlash",          "torque_saturation",
                                         "payload",         "stribeck_friction", "load_dependent_friction"};
// Nothing else bends a motion as this does.
constexpr const char* without_twin = "torque_saturation";
constexpr const char* unknown_kinds[] = {"unknown_periodic", "unknown_product", "unknown_wander"};

double between(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}
double one_of(std::mt19937_64& random, double low, double high, double other_low, double other_high) {
  return random() % 2 == 0 ? between(random, low, high) : between(random, other_low, other_high);
}

struct ServoDraw {
  std::vector<Effect> effects;
  std::string unknown;
  int unknown_joint = 0;  // from 0
  double unknown_size = 0.0, unknown_rate = 0.0;
  std::vector<std::string> withheld;
};

/// What a case is played on, and how its joints move when healthy.
struct ServoStage {
  Robot nominal, real;
  double rate = 0.0, duration = 0.0;
  std::vector<Trajectory> commands;
  Eigen::VectorXd lag, speed, largest, load;  // [rad, rad/s, rad, N m] of each joint
};

ServoStage stage_of(const Robot& nominal, const BlindOptions& options, BlindKind kind,
                    std::mt19937_64& random) {
  ServoStage s;
  s.nominal = with_random_servos(
      options.family && !options.given_robot ? random_family_robot(random()) : nominal, random());
  const int n = s.nominal.size();
  double fastest = 0.0;
  s.lag = s.speed = s.largest = s.load = Eigen::VectorXd::Zero(n);
  const std::vector<JointScale> scales = joint_scales(s.nominal);
  for (int j = 0; j < n; ++j) {
    const auto k = static_cast<std::size_t>(j);
    fastest = std::max(fastest, std::sqrt(s.nominal.joints[k].servo->kp / scales[k].inertia));
    s.load[j] = scales[k].gravity;
  }
  constexpr double rates[] = {50.0, 100.0, 250.0};
  const std::size_t slowest = fastest < 30.0 ? 0 : fastest < 60.0 ? 1 : 2;
  s.rate = rates[slowest + random() % (3 - slowest)];
  s.duration = between(random, 15.0, 35.0);
  RandomMotionOptions motion;
  motion.rate = s.rate;
  motion.base_frequency = 0.1;
  motion.harmonics = 6;
  for (int l = 0; l < 2; ++l) {
    s.commands.push_back(random_motion(s.nominal, s.duration, random(), motion));
    const Trajectory& c = s.commands.back();
    Log log;
    log.t = c.t;
    log.q = log.u = c.q;
    const ServoReplay healthy = replay_servos(s.nominal, log, 4);
    s.largest = s.largest.cwiseMax((healthy.q - c.q).cwiseAbs().colwise().maxCoeff().transpose());
    s.speed += (c.dq.colwise().squaredNorm().transpose() / double(c.dq.rows())).cwiseSqrt() / 2.0;
  }
  for (int j = 0; j < n; ++j) {
    const Servo& servo = *s.nominal.joints[static_cast<std::size_t>(j)].servo;
    s.lag[j] = servo.kd / servo.kp * s.speed[j];
  }
  s.real = kind == BlindKind::nominal ? perturbed_servos(s.nominal, 0.02, random()) : s.nominal;
  return s;
}

/// An effect of joint `j` (from 0); its numbers are multiples of the joint's own.
Effect of_joint(const ServoStage& s, const std::string& name, int j, double strength,
                std::mt19937_64& random) {
  const auto k = static_cast<std::size_t>(j);
  const Joint& joint = s.nominal.joints[k];
  const Servo& servo = *joint.servo;
  const double w = std::sqrt(servo.kp / joint_scales(s.nominal)[k].inertia), lag = s.lag[j];
  Effect e = {name, {j + 1}, {}};
  const auto put = [&](const char* key, double x) {
    e.parameters[key].assign(s.nominal.joints.size(), 0.0);
    e.parameters[key][k] = x;
  };
  if (name == "servo_stiffness") {
    put("kp", servo.kp * (1.0 + strength * one_of(random, -0.5, -0.25, 0.35, 1.0)));
  } else if (name == "servo_damping") {
    put("coefficient", servo.kd * strength * one_of(random, -0.5, -0.3, 0.4, 1.0));
  } else if (name == "command_delay") {
    put("delay", strength * std::max(between(random, 0.3, 0.9) / w, 1.0 / s.rate));
  } else if (name == "command_filter") {
    put("time_constant", strength * between(random, 0.4, 1.2) / w);
  } else if (name == "coulomb_friction") {
    put("coefficient", strength * servo.kp * between(random, 0.25, 0.8) * lag);
    put("velocity_scale", sharp * s.speed[j]);
  } else if (name == "rotor_inertia") {
    put("armature", strength * servo.kp / (w * w) * between(random, 0.6, 2.5));
  } else if (name == "encoder_offset") {
    put("offset", strength * lag * one_of(random, -1.0, -0.3, 0.3, 1.0));
  } else if (name == "backlash") {
    put("gap", strength * lag * between(random, 0.4, 1.2));
  } else if (name == "torque_saturation") {
    put("limit", servo.kp * s.largest[j] * (1.0 - strength * between(random, 0.25, 0.55)));
  } else if (name == "stribeck_friction") {
    put("static", strength * servo.kp * between(random, 0.3, 0.8) * lag);
    put("stribeck_velocity", s.speed[j] * between(random, 0.15, 0.4));
    put("velocity_scale", sharp * s.speed[j]);
    put("exponent", 2.0);
  } else {
    put("coefficient", strength * between(random, 0.15, 0.4));
    put("velocity_scale", sharp * s.speed[j]);
  }
  return e;
}

Effect drawn_effect(const ServoStage& s, std::string name, double strength, std::mt19937_64& random) {
  const int n = s.nominal.size();
  std::vector<int> loaded;  // joints on which friction with the load is felt
  for (int j = 0; j < n; ++j)
    if (s.load[j] > s.lag[j] * s.nominal.joints[static_cast<std::size_t>(j)].servo->kp) loaded.push_back(j);
  if (name == "load_dependent_friction" && loaded.empty()) name = "coulomb_friction";
  if (name == "payload") return draw_family_effect(name, s.nominal, random(), strength, s.duration);
  if (name == "load_dependent_friction")
    return of_joint(s, name, loaded[random() % loaded.size()], strength, random);
  return of_joint(s, name, static_cast<int>(random() % static_cast<unsigned long>(n)), strength, random);
}

/// rms [encoder steps] by which an effect changes the motion of the joint that shows it most.
double seen(const ServoStage& s, const Effect& effect) {
  SimulateServosOptions options;
  options.rate = s.rate;
  const Eigen::VectorXd step = encoder_steps(s.nominal, options.encoder_step);
  options.encoder_step = 0.0;
  const Eigen::MatrixXd with = simulate_servos(s.real, {effect}, s.commands[0], options).q,
                        without = simulate_servos(s.real, {}, s.commands[0], options).q;
  return ((with - without).colwise().norm().transpose().cwiseQuotient(step) / std::sqrt(double(with.rows())))
      .maxCoeff();
}

ServoDraw draw_case(const ServoStage& s, BlindKind kind, std::mt19937_64& random) {
  const double strength = kind == BlindKind::weak ? 0.3 : 1.0;
  const auto any = [&] { return std::string(drawn_effects[random() % std::size(drawn_effects)]); };
  ServoDraw draw;
  const double which = between(random, 0.0, 1.0);
  if (which < 0.14) return draw;
  if (which < 0.24) {
    draw.unknown = unknown_kinds[random() % std::size(unknown_kinds)];
    draw.unknown_joint = static_cast<int>(random() % static_cast<unsigned long>(s.nominal.size()));
    draw.unknown_size = strength * between(random, 0.5, 1.2);
    draw.unknown_rate = between(random, 3.0, 8.0);
    return draw;
  }
  if (which < 0.28) {
    draw.withheld = {without_twin};
    draw.effects.push_back(drawn_effect(s, without_twin, strength, random));
    return draw;
  }
  // An effect that its arm's motion does not show is none to look for.
  constexpr double least_seen = 4.0;  // encoder steps
  constexpr int most_draws = 50;
  for (int k = 0; k < most_draws && draw.effects.size() < (which < 0.43 ? 2U : 1U); ++k) {
    const Effect e = drawn_effect(s, any(), strength, random);
    if ((draw.effects.empty() || draw.effects[0].name != e.name) && seen(s, e) >= strength * least_seen)
      draw.effects.push_back(e);
  }
  if (draw.effects.empty()) throw Error("blind: no effect shows on this arm");
  return draw;
}

/// A torque that no library has, in multiples of what the joint's lag makes.
std::function<void(double, const Eigen::VectorXd&, const Eigen::VectorXd&, Eigen::VectorXd&)> disturbance(
    const ServoStage& s, const ServoDraw& draw, unsigned long seed) {
  if (draw.unknown.empty()) return nullptr;
  const int j = draw.unknown_joint, n = s.nominal.size();
  const double size = draw.unknown_size * s.nominal.joints[static_cast<std::size_t>(j)].servo->kp * s.lag[j];
  if (draw.unknown == "unknown_periodic")  // time, not motion, drives it
    return [=](double t, const auto&, const auto&, Eigen::VectorXd& tau) {
      tau[j] += size * std::sin(draw.unknown_rate * t);
    };
  if (draw.unknown == "unknown_product") {  // two joints' positions and speeds together
    const int other = (j + 3) % n, third = (j + 2) % n;
    const double speed = s.speed[third];
    return [=](double, const Eigen::VectorXd& q, const Eigen::VectorXd& dq, Eigen::VectorXd& tau) {
      tau[j] += 1.5 * size * std::sin(2.0 * q[other]) * dq[third] / speed;
    };
  }
  std::vector<double> wander;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  double x = 0.0, smooth = 0.0;
  constexpr double dt = 0.01;
  const auto steps = static_cast<std::size_t>(std::ceil(s.duration / dt)) + 2;
  for (std::size_t k = 0; k < steps; ++k) {
    x += -x * dt / 0.5 + normal(random) * std::sqrt(2.0 * dt / 0.5);
    smooth += (x - smooth) * dt / 0.1;
    wander.push_back(smooth);
  }
  return [=](double t, const auto&, const auto&, Eigen::VectorXd& tau) {
    const double at = std::clamp(t / dt, 0.0, double(wander.size() - 2));
    const auto i = static_cast<std::size_t>(at);
    tau[j] += size * (wander[i] + (at - double(i)) * (wander[i + 1] - wander[i]));
  };
}

/// The truth in the words of the diagnosis: changes are counted from the nominal model, whose own errors are
/// in them; a payload is in the last link's frame.
nlohmann::json label_of(const ServoStage& s, const ServoDraw& draw) {
  nlohmann::json label = nlohmann::json::array();
  for (Effect e : draw.effects) {
    for (const int number : e.joints) {
      const auto j = static_cast<std::size_t>(number - 1);
      const Joint &real = s.real.joints[j], &nominal = s.nominal.joints[j];
      if (e.name == "servo_damping")
        e.parameters.at("coefficient")[j] += real.servo->kd + real.friction.linear.viscous -
                                             nominal.servo->kd - nominal.friction.linear.viscous;
      if (e.name == "coulomb_friction")
        e.parameters.at("coefficient")[j] += real.friction.linear.coulomb - nominal.friction.linear.coulomb;
      if (e.name == "rotor_inertia")
        e.parameters.at("armature")[j] += real.rotor_inertia - nominal.rotor_inertia;
    }
    if (e.name == "payload") {
      std::vector<double>& com = e.parameters.at("com");
      const Eigen::Vector3d there = s.nominal.tip * Eigen::Vector3d(com[0], com[1], com[2]);
      com.assign(there.begin(), there.end());
    }
    label.push_back({{"name", e.name}, {"joints", e.joints}, {"parameters", e.parameters}});
  }
  if (!draw.unknown.empty())
    label.push_back({{"name", draw.unknown},
                     {"joints", {draw.unknown_joint + 1}},
                     {"parameters", nlohmann::json::object()}});
  return label;
}

/// Two motions of one robot, in files.
void record(const ServoStage& s, const ServoDraw& draw, unsigned long seed, const fs::path& folder) {
  fs::create_directories(folder);
  for (std::size_t l = 0; l < s.commands.size(); ++l) {
    SimulateServosOptions options;
    options.rate = s.rate;
    options.seed = seed + l;
    options.disturbance = disturbance(s, draw, seed + l);
    Log log = simulate_servos(s.real, draw.effects, s.commands[l], options).log;
    log.dq.resize(0, 0);  // positions are what every such arm gives
    write_log((folder / (l == 0 ? "log_a.csv" : "log_b.csv")).string(), log);
  }
  write_file((folder / "model.yaml").string(), to_yaml({s.nominal, {}, {}}));
}

std::string case_name(int index) {
  std::string digits = std::to_string(index);
  return "case_" + std::string(digits.size() < 5 ? 5 - digits.size() : 0, '0') + digits;
}

/// One case: drawn, recorded, diagnosed from its files.
void play(const Robot& nominal, const BlindOptions& options, int index, const fs::path& logs,
          const fs::path& sealed, BlindCase& here) {
  const BlindKind kind = detail::kind_of(options, index);
  const fs::path folder = logs / case_name(index);
  DiagnoseServosOptions diagnose;
  diagnose.rollout = false;
  for (int attempt = 0; attempt < draws_of_a_case; ++attempt) {
    try {
      std::seed_seq sequence{options.seed, static_cast<unsigned long>(index),
                             static_cast<unsigned long>(attempt), 0x736572766f73UL};
      std::mt19937_64 random(sequence);
      const ServoStage stage = stage_of(nominal, options, kind, random);
      const ServoDraw draw = draw_case(stage, kind, random);
      record(stage, draw, random(), folder);
      write_file((sealed / (case_name(index) + ".json")).string(), label_of(stage, draw).dump(1) + "\n");
      here.withheld = draw.withheld;
      here.drawn = {{"robot", stage.nominal.name},
                    {"joints", std::to_string(stage.nominal.size())},
                    {"rate", std::to_string(stage.rate)},
                    {"duration", std::to_string(stage.duration)},
                    {"logs", "2"}};
      break;
    } catch (const Error&) {
      if (attempt + 1 == draws_of_a_case) throw;
    }
  }
  diagnose.withhold = options.diagnose.withhold;
  diagnose.withhold.insert(diagnose.withhold.end(), here.withheld.begin(), here.withheld.end());
  const Robot model = read_model((folder / "model.yaml").string()).robot;
  LogColumns columns;
  columns.dq = columns.tau = false;
  const Diagnosis d = diagnose_servos(model,
                                      {read_log((folder / "log_a.csv").string(), model.size(), columns),
                                       read_log((folder / "log_b.csv").string(), model.size(), columns)},
                                      diagnose);
  detail::set_answer(d, here);
}

}  // namespace

Robot with_random_servos(const Robot& robot, unsigned long seed) {
  constexpr double most_bent = 0.03;  // of the travel, by gravity
  std::mt19937_64 random(seed);
  Robot out = robot;
  out.effects.clear();
  for (Joint& joint : out.joints) {
    joint.friction = {};
    joint.rotor_inertia = 0.0;
  }
  const std::vector<JointScale> scales = joint_scales(out);
  for (std::size_t j = 0; j < scales.size(); ++j) {
    Joint& joint = out.joints[j];
    const JointScale& s = scales[j];
    joint.rotor_inertia = between(random, 0.1, 0.5) * s.inertia;
    const double inertia = s.inertia + joint.rotor_inertia;
    const double w =
        std::max(between(random, 12.0, 28.0), std::sqrt(s.gravity / (most_bent * s.travel * inertia)));
    Servo servo;
    servo.kp = inertia * w * w;
    servo.kd = 2.0 * between(random, 0.5, 1.2) * w * inertia;
    joint.friction.linear.viscous = 0.1 * servo.kd;
    joint.friction.linear.coulomb = between(random, 0.002, 0.006) * servo.kp * s.travel / 5.0;
    joint.servo = servo;
    joint.limits.velocity = 0.2 * s.travel;  // [1/s]: a travel in five seconds at most
    joint.limits.acceleration = 0.8 * s.travel;
  }
  return out;
}

std::vector<BlindCase> run_servo_blind(const Robot& nominal, const BlindOptions& options) {
  if (options.kind == BlindKind::vendor)
    throw Error("blind: the kind vendor is of torque logs: a vendor's model has no servos");
  const fs::path logs = fs::path(options.folder) / "logs", sealed = fs::path(options.folder) / "sealed";
  std::error_code error;
  fs::create_directories(logs, error);
  if (!error) fs::create_directories(sealed, error);
  if (error) throw Error(options.folder + ": cannot be made: " + error.message());
  std::vector<BlindCase> cases(static_cast<std::size_t>(options.cases));
  std::mutex mutex;
  int done = 0;
  tbb::parallel_for(0, options.cases, [&](int k) {
    if (options.stop != nullptr && *options.stop) return;
    BlindCase& here = cases[static_cast<std::size_t>(k)];
    try {
      play(nominal, options, k, logs, sealed, here);
    } catch (const std::exception& failure) {
      here.failure = failure.what();
    }
    const std::lock_guard<std::mutex> lock(mutex);
    ++done;
    if (options.progress) options.progress(done, options.cases);
  });
  // Only now are the labels opened.
  for (int k = 0; k < options.cases; ++k) {
    const std::string path = (sealed / (case_name(k) + ".json")).string();
    if (!fs::exists(path)) continue;
    for (const nlohmann::json& e : nlohmann::json::parse(read_file(path))) {
      cases[static_cast<std::size_t>(k)].truth.push_back({e["name"], e["joints"], e["parameters"]});
      cases[static_cast<std::size_t>(k)].truth_shares.push_back(0.0);
    }
  }
  return cases;
}

}  // namespace dynid
