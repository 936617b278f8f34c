// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/servo_diagnose.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>

#include "dynid/base/error.hpp"
#include "dynid/base/statistics.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/identification/servo.hpp"
#include "servo_gap.hpp"
#include "servo_judge.hpp"
#include "servo_report.hpp"

namespace dynid {
namespace {

using namespace detail;

/// The motion error of a model on every log: N x n, log after log.
std::vector<Eigen::MatrixXd> motion_errors(const Robot& robot, const std::vector<Log>& logs) {
  std::vector<Eigen::MatrixXd> out(logs.size());
  tbb::parallel_for(std::size_t{0}, logs.size(),
                    [&](std::size_t l) { out[l] = logs[l].q - replay_servos(robot, logs[l]).q; });
  return out;
}

class ServoDiagnosis {
 public:
  ServoDiagnosis(const Robot& nominal, const std::vector<Log>& logs, const DiagnoseServosOptions& options)
      : nominal_(nominal), logs_(logs), options_(options) {}

  Diagnosis run() {
    const auto start = std::chrono::steady_clock::now();
    check();
    say("replaying the nominal model", 0.0);
    std::vector<DataIssue> issues;
    check_servo_logs(logs_, nominal_, issues);
    describe_servo_logs(nominal_, logs_, issues, d_);
    judging_ = judging_rows(logs_, false);
    const bool body = std::any_of(nominal_.joints.begin(), nominal_.joints.end(),
                                  [](const Joint& j) { return j.servo->kp > 0.0; });
    series_ = servo_series(logs_, body ? std::optional<Robot>(nominal_) : std::nullopt);
    if (body) add_load_parts(nominal_, logs_, options_.tolerance, series_);
    before_ = motion_errors(nominal_, logs_);
    for (const Joint& joint : nominal_.joints) d_.unit.push_back(joint_units(joint.type).position);
    if (measure_floors()) {
      for (int j = 0; j < nominal_.size(); ++j)
        answers_.push_back({whole(j), {}, {}, {}, {}, {}, 0.0, false});
      std::vector<ServoProblemOfJoint> problems;
      for (const ServoAnswer& a : answers_) problems.push_back(a.problem);
      measure_servo_gap(logs_, before_, problems, d_);
      spread_judging();
      suspect();
      if (d_.p_value <= options_.criteria.detection ||
          std::count(suspected_.begin(), suspected_.end(), 1) > 0)
        seek(body);
      finish();
    } else {
      const auto n = static_cast<Eigen::Index>(nominal_.joints.size());
      d_.rms = d_.floor = d_.tolerance = d_.upper = Eigen::VectorXd::Zero(n);
      d_.verdict = Verdict::data_invalid;
      d_.next.text = "Record a log in which the commands move every joint.";
    }
    d_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(d_);
  }

 private:
  void check() const {
    validate(nominal_);
    for (const Joint& joint : nominal_.joints)
      if (!joint.servo)
        throw Error("robot '" + nominal_.name + "': joint '" + joint.name +
                    "' has no servo: a diagnosis from commands needs one on every joint (dynid identify "
                    "--servo, or position actuators in an MJCF)");
  }

  void say(const std::string& stage, double fraction) const {
    if (options_.progress) options_.progress(stage, fraction);
  }

  /// A log that judges and does not show any joint's gap can bear nothing out, and one that alone shows it
  /// leaves nothing to fit: then parts of every log judge, where these do better.
  void spread_judging() {
    const double detection = options_.criteria.detection;
    if (logs_.size() < 2 || gap_shows_on_both(before_, judging_, d_, detection)) return;
    const std::vector<std::vector<char>> parts = judging_rows(logs_, true);
    if (!gap_shows_on_both(before_, parts, d_, detection)) return;
    judging_ = parts;
    for (std::size_t j = 0; j < answers_.size(); ++j) answers_[j].problem = whole(static_cast<int>(j));
  }

  /// The joint's motion differs by more than noise and tolerance make: of as many joints one soon does.
  bool off(std::size_t joint) const {
    return std::any_of(d_.where.begin(), d_.where.end(), [&](const GapCell& cell) {
      return cell.joint == static_cast<int>(joint) + 1 &&
             cell.p_value * double(nominal_.size()) <= options_.criteria.detection;
    });
  }

  /// A gap smaller than what errors within the tolerance may make is none of theirs where it has not their
  /// shape: joints that are not off by the size of it, but whose motion the nominal parameters, moved within
  /// the tolerance, do not follow to the noise, or only far from where they are said to be.
  void suspect() {
    suspected_.assign(answers_.size(), 0);
    evidence_.assign(answers_.size(), 0.0);
    tbb::parallel_for(std::size_t{0}, answers_.size(), [&](std::size_t j) {
      const ServoProblemOfJoint p = searched(j);
      if (off(j) || !p.scale.moves) return;
      const ServoChoice none = no_servo_effect(p);
      suspected_[j] = std::sqrt(2.0 * none.fit.loss) > options_.criteria.form_error * p.floor ||
                      none.fit.penalty > options_.criteria.effect_gain + options_.criteria.unlikely_change;
    });
  }

  /// What a search found on a joint that is suspected only. A rigid body that is off within the tolerance
  /// leaves such gaps in any shape: an effect is one where it explains all but a twentieth, or more than it
  /// leaves and that to the noise, and its evidence is as large as for a name, times the number of joints.
  ServoChoice convincing(std::size_t j, const ServoProblemOfJoint& p, ServoChoice found) {
    ServoChoice none = no_servo_effect(p);
    const double width = std::min(none.fit.width, found.fit.width),
                 samples = std::max(none.samples, found.samples);
    const auto evidence = [&](KnobFit fit) {
      fit.loss = servo_loss(p, fit.x, RowSet::fit, width);
      return log_evidence(p, fit, samples);
    };
    double gain = evidence(found.fit) - evidence(none.fit) - std::log(double(answers_.size()));
    for (const WeighedServoEffect& w : found.effects) gain -= price_of(w.effect, samples);
    const double floor = options_.criteria.form_error * p.floor,
                 left = 2.0 * servo_loss(p, found.fit.x, RowSet::fit, width),
                 was = 2.0 * servo_loss(p, none.fit.x, RowSet::fit, width);
    if (found.effects.empty() || gain < options_.criteria.effect_gain ||
        left > std::max(std::min(floor * floor, options_.criteria.most_left_of_noise * was),
                        options_.criteria.most_left * was))
      return none;
    evidence_[j] = gain;
    return found;
  }

  /// Joints whose gap shows in an effect, not in its size.
  void detect_suspected() {
    by_size_ = d_.p_value;
    where_by_size_ = d_.where;
    for (std::size_t j = 0; j < answers_.size(); ++j) {
      if (!suspected_[j] || answers_[j].effects.empty()) continue;
      const double p = std::exp(-evidence_[j]);
      d_.p_value = std::min(d_.p_value, p);
      for (GapCell& cell : d_.where)
        if (cell.joint == static_cast<int>(j) + 1) cell.p_value = std::min(cell.p_value, p);
    }
    if (payload_.present) d_.p_value = std::min(d_.p_value, 1.0 - payload_.probability);
    d_.structure_p_value = d_.p_value;
  }

  /// Noise of each joint's position; of one that never moves that of the others, which have such encoders.
  /// False where no command moves.
  bool measure_floors() {
    std::vector<double> seen;
    bool moves = false;
    for (const std::vector<ServoSeries>& of_joint : series_) {
      floors_.push_back(position_floor(of_joint));
      if (floors_.back() > 0.0) seen.push_back(floors_.back());
      moves = moves || knob_scale(of_joint).moves;
    }
    if (!moves) return false;
    const double usual = median(std::move(seen));
    for (double& floor : floors_)
      if (floor <= 0.0) floor = usual;
    return true;
  }

  ServoProblemOfJoint problem(int joint, int most_rows) const {
    const auto j = static_cast<std::size_t>(joint);
    return joint_problem(nominal_, joint, series_[j], judging_, options_, floors_[j], most_rows);
  }
  ServoProblemOfJoint whole(int joint) const { return problem(joint, 0); }
  ServoProblemOfJoint searched(std::size_t joint) const {
    return problem(static_cast<int>(joint), options_.criteria.searched_rows);
  }

  bool withheld(const char* name) const {
    return std::find(options_.withhold.begin(), options_.withhold.end(), name) != options_.withhold.end();
  }

  /// Every joint whose motion is off is searched by itself.
  std::vector<ServoChoice> search(const ServoPayload& payload, const PayloadLoads* loads, double from,
                                  double to) {
    const std::size_t n = answers_.size();
    std::vector<ServoChoice> out(n);
    std::mutex mutex;
    std::size_t done = 0;
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, n, 1),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t j = range.begin(); j != range.end(); ++j) {
            ServoProblemOfJoint p = searched(j);
            if (loads != nullptr && payload.present) loads->add(payload, static_cast<int>(j), p);
            if (!off(j) && !suspected_[j])
              out[j] = no_servo_effect(p);
            else
              out[j] = search_servo(p, options_.withhold, options_.criteria);
            if (!off(j) && suspected_[j]) out[j] = convincing(j, p, std::move(out[j]));
            const std::lock_guard<std::mutex> lock(mutex);
            ++done;
            say("seeking effects", from + (to - from) * double(done) / double(n));
          }
        },
        tbb::simple_partitioner());
    return out;
  }

  void seek(bool body) {
    std::vector<ServoChoice> choices = search({}, nullptr, 0.1, 0.5);
    std::optional<PayloadLoads> loads;
    if (body && !withheld("payload")) {
      loads.emplace(nominal_, logs_);
      // Alone first: a payload that is all there is leaves its marks on many joints, each with a name of its
      // own.
      if (!with_payload(choices, *loads, false)) with_payload(choices, *loads, true);
    }
    say("judging", 0.8);
    for (std::size_t j = 0; j < answers_.size(); ++j) {
      answers_[j].choice = std::move(choices[j]);
      answers_[j].within_tolerance = suspected_[j] != 0;
      if (payload_.present) loads->add(payload_, static_cast<int>(j), answers_[j].problem);
    }
    tbb::parallel_for(std::size_t{0}, answers_.size(),
                      [&](std::size_t j) { judge_servo(answers_[j], options_.criteria); });
    if (payload_.present) refine_payload(*loads);
    detect_suspected();
  }

  /// The payload once more, beside what was found, on every row and in the finer steps of the judge.
  void refine_payload(const PayloadLoads& loads) {
    std::vector<KnobFit> fits;
    std::vector<double> samples;
    std::vector<ServoProblemOfJoint> problems;
    for (std::size_t j = 0; j < answers_.size(); ++j) {
      fits.push_back(answers_[j].fit);
      samples.push_back(answers_[j].samples);
      problems.push_back(whole(static_cast<int>(j)));
    }
    const ServoPayload refined = fit_payload(nominal_, loads, problems, fits, samples, payload_);
    if (!refined.present) return;
    payload_.value = refined.value;
    payload_.covariance = refined.covariance;
    for (std::size_t j = 0; j < answers_.size(); ++j) {
      loads.add(payload_, static_cast<int>(j), problems[j]);
      answers_[j].problem = std::move(problems[j]);
    }
  }

  /// Seeks a payload by itself, or `beside` those of the joints' effects that it does not take the place of;
  /// kept with the choices that go with it where the evidence for both together is larger.
  bool with_payload(std::vector<ServoChoice>& choices, const PayloadLoads& loads, bool beside) {
    const std::size_t n = choices.size();
    std::vector<KnobFit> fits(n);
    std::vector<std::vector<Knob>> kept(n);
    std::vector<double> samples(n);
    std::vector<ServoProblemOfJoint> problems(n);
    tbb::parallel_for(std::size_t{0}, n, [&](std::size_t j) {
      ServoProblemOfJoint p = searched(j);
      std::vector<int> stay;
      for (const WeighedServoEffect& w : choices[j].effects) {
        const Knob k = servo_effects()[static_cast<std::size_t>(w.effect)].free.front();
        if (beside && k != Knob::bias && k != Knob::gravity_compensation && k != Knob::spring &&
            k != Knob::inertia)
          stay.push_back(w.effect);
      }
      kept[j] = freed(stay);
      Knobs x = p.nominal;
      for (const Knob k : kept[j]) x[at(k)] = choices[j].fit.x[at(k)];
      fits[j] = fit_knobs(p, x, kept[j], RowSet::fit, servo_width(p, x), choices[j].samples, 8);
      samples[j] = choices[j].samples;
      problems[j] = std::move(p);
    });
    ServoPayload payload = fit_payload(nominal_, loads, problems, fits, samples);
    // What is left with it is smaller, and the nominal's own errors are others: by turns.
    for (int round = 0; round < 2 && payload.present; ++round) {
      tbb::parallel_for(std::size_t{0}, n, [&](std::size_t j) {
        ServoProblemOfJoint loaded = problems[j];
        loads.add(payload, static_cast<int>(j), loaded);
        fits[j] =
            fit_knobs(loaded, fits[j].x, kept[j], RowSet::fit, servo_width(loaded, fits[j].x), samples[j], 8);
      });
      payload = fit_payload(nominal_, loads, problems, fits, samples, payload);
    }
    if (!payload.present || payload.gain <= options_.criteria.effect_gain) return false;
    std::vector<ServoChoice> with = search(payload, &loads, 0.5, 0.8);
    double gain = -2.0 * std::log(*std::max_element(samples.begin(), samples.end())) -
                  std::log(double(servo_effects().size()));
    std::vector<double> gains(n);
    tbb::parallel_for(std::size_t{0}, n,
                      [&](std::size_t j) { gains[j] = compared(j, choices[j], with[j], payload, loads); });
    for (const double g : gains) gain += g;
    if (gain <= options_.criteria.effect_gain) return false;
    payload.gain = gain;
    payload.probability = probability_of(gain, {});
    payload_ = payload;
    choices = std::move(with);
    return true;
  }

  /// Evidence of a joint's set with the payload, less that of its set without: one width, one count.
  double compared(std::size_t j, const ServoChoice& without, const ServoChoice& with,
                  const ServoPayload& payload, const PayloadLoads& loads) const {
    ServoProblemOfJoint p = searched(j), loaded = p;
    loads.add(payload, static_cast<int>(j), loaded);
    const double width = std::min(servo_width(p, without.fit.x), servo_width(loaded, with.fit.x));
    const double samples = std::max(without.samples, with.samples);
    const auto evidence = [&](const ServoProblemOfJoint& of, const ServoChoice& c) {
      KnobFit fit = c.fit;
      fit.loss = servo_loss(of, fit.x, RowSet::fit, width);
      double out = log_evidence(of, fit, samples);
      for (const WeighedServoEffect& w : c.effects) out -= price_of(w.effect, samples);
      return out;
    };
    return evidence(loaded, with) - evidence(p, without);
  }

  /// Verdict, shrink, series, rollout, text.
  void finish() {
    d_.effects = found_servo_effects(nominal_, answers_, payload_, d_.rms, options_.criteria);
    if (d_.p_value > options_.criteria.detection)
      d_.effects.clear();  // one joint of many is soon off by chance
    const Robot patched = patched_servos(nominal_, d_.effects);
    const std::vector<Eigen::MatrixXd> after = d_.effects.empty() ? before_ : motion_errors(patched, logs_);
    fill_servo_series(logs_, before_, after, judging_, d_);
    shrink_servo(logs_, before_, after, judging_, d_);
    rank_servo_effects(answers_, d_);
    servo_verdict(options_.criteria, d_);
    if (d_.verdict == Verdict::unexplained && by_size_ > options_.criteria.detection) {
      // A gap that only an effect shows stands and falls with that effect.
      d_.p_value = d_.structure_p_value = by_size_;
      d_.where = where_by_size_;
      d_.series = {};
      d_.effects.clear();
      d_.ranking.clear();
      d_.considered.clear();
      d_.judgement.clear();
      fill_servo_series(logs_, before_, before_, judging_, d_);
      shrink_servo(logs_, before_, before_, judging_, d_);
      rank_servo_effects(answers_, d_);
      servo_verdict(options_.criteria, d_);
    }
    if (d_.verdict == Verdict::unexplained) d_.effects.clear();
    if (options_.rollout) {
      say("replaying short horizons", 0.95);
      d_.rollout = servo_rollout(nominal_, d_.effects.empty() ? nominal_ : patched, logs_, judging_);
    }
    servo_next_experiment(d_);
  }

  const Robot& nominal_;
  const std::vector<Log>& logs_;
  const DiagnoseServosOptions& options_;
  Diagnosis d_;
  std::vector<std::vector<char>> judging_;
  std::vector<std::vector<ServoSeries>> series_;
  std::vector<ServoAnswer> answers_;
  std::vector<double> floors_;
  std::vector<Eigen::MatrixXd> before_;
  ServoPayload payload_;
  std::vector<char> suspected_;
  double by_size_ = 1.0;  // p-value of the gap by its size
  std::vector<GapCell> where_by_size_;
  std::vector<double> evidence_;  // [nats] of what was found on a suspected joint
};

}  // namespace

const std::vector<std::string>& servo_effect_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const ServoEffect& e : servo_effects()) out.emplace_back(e.name);
    return out;
  }();
  return names;
}

Diagnosis diagnose_servos(const Robot& nominal, const std::vector<Log>& logs,
                          const DiagnoseServosOptions& options) {
  return ServoDiagnosis(nominal, logs, options).run();
}

}  // namespace dynid
