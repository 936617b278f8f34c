// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <string>

#include "dynid/estimation/contact_detector.hpp"
#include "dynid/estimation/contact_test.hpp"
#include "dynid/estimation/external_wrench.hpp"
#include "dynid/estimation/momentum_observer.hpp"
#include "dynid/estimation/motion_filter.hpp"
#include "dynid/estimation/status.hpp"
#include "dynid/estimation/torque_model.hpp"
#include "dynid/estimation/triple_buffer.hpp"

namespace dynid {

/// Set-up of a TorqueEstimator. Vectors over joints: n values, one value for all joints, or empty for the
/// default.
struct TorqueEstimatorOptions {
  Eigen::VectorXd gain;  ///< K [1/s] of the observer; default 60
  ObserverOrder order = ObserverOrder::first;
  double damping = 1.0;  ///< zeta of the second-order form
  /// [N m] of the residual; default 0.3 sqrt(torque limit / 1 N m): 2.8 for 87 N m, 1.04 for 12 N m; 2 where
  /// the limit is unknown.
  Eigen::VectorXd contact_threshold;
  double contact_release = 0.6;  ///< part of the threshold below which a contact ends
  Eigen::Isometry3d wrench_frame = Eigen::Isometry3d::Identity();  ///< pose in the *tip* frame
  ExternalWrenchOptions wrench;
  double acceleration_cutoff = 30.0;  ///< [Hz] of the first-order filter behind the difference of dq
  double longest_dt = 0.1;            ///< [s] a longer step is a gap
  /// [s] for which a sample that repeats the one before (a lost packet) is waited out: its outputs are held.
  double bridge = 0.003;
  /// Of the model; ObserverOrder::kalman needs it, `gain` is then K where the variance is its constant: K
  /// sigma_0 / sigma elsewhere, once settled. With it there is a ContactTest beside the thresholds, and
  /// velocity and acceleration are those of a MotionFilter, whatever dq is given.
  std::optional<Uncertainty> uncertainty = {};
  ContactTestOptions test;
};

/// What a cycle gives. Torques [N m]: n, base to tip.
template <int N = Eigen::Dynamic>
struct Estimate {
  using Vector = Eigen::Matrix<double, N, 1>;

  Status status = Status::ok;
  Vector dq;            ///< [rad/s] velocity in use: as measured, or of the MotionFilter
  Vector ddq;           ///< [rad/s^2] acceleration that tau_model is for: the desired or the estimated one
  Vector tau_model;     ///< M ddq + S dq + g + Ia ddq + friction + compensated effects
  Vector tau_friction;  ///< friction and compensated effects, alone
  Vector tau_external;  ///< tau_model - tau: sign as the residual, no delay but that of ddq, noisy
  Vector residual;      ///< r of the momentum observer
  Eigen::Array<bool, N, 1> contact;                                          ///< |r| over its threshold
  Eigen::Matrix<double, 6, 1> wrench = Eigen::Matrix<double, 6, 1>::Zero();  ///< [N, N m] from the residual
  double singular_margin = 0.0;                                              ///< [m] see ExternalWrench
  Vector external;      ///< tau_ext between the last two samples by the momentum, not filtered
  Contact<N> pushed;    ///< by the ContactTest; nothing ever, without TorqueEstimatorOptions::uncertainty
  bool tested = false;  ///< `pushed` is in use
};

/// Everything that runs beside a robot at 1 kHz: model torque, friction, external torque in two ways,
/// external wrench and contact.
///
/// Sign. `tau` is the joint torque that the motors bring up (what the torque sensors of a Panda show): tau =
/// M ddq + S dq + g + friction - tau_ext. External torques are De Luca's r: *positive when the environment
/// pushes the robot* in the joint's positive direction. Franka's `tau_ext_hat_filtered` is its negative.
///
/// step() is for one thread, noexcept, free of allocations, locks and logging; adopt() and retune() may
/// be called from one other thread at any time and never delay step(). They and the constructor throw and
/// allocate.
template <int N = Eigen::Dynamic>
class TorqueEstimator {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  /// Throws Error where TorqueModel does, and on an option out of range or of a wrong size.
  explicit TorqueEstimator(const Robot& robot, const TorqueEstimatorOptions& options = {})
      : TorqueEstimator(TorqueModel<N>(robot), options) {}
  explicit TorqueEstimator(const TorqueModel<N>& model, const TorqueEstimatorOptions& options = {})
      : models_(model),
        limits_(model.torque_limit()),
        tunings_(tuning(limits_, options)),
        ws_(model.rigid_body()),
        observer_(tunings_.front().gain, options.order, options.damping),
        contact_(tunings_.front().threshold, tunings_.front().release),
        wrench_(model.rigid_body(), model.rigid_body().tip() * options.wrench_frame, options.wrench),
        options_(options),
        motion_(model.size()),
        test_(model.size()) {
    positive(options.longest_dt, "longest_dt");
    if (!(options.bridge >= 0.0 && options.bridge < options.longest_dt))
      throw Error("bridge: must be in [0, longest_dt) s");
    for (Vector* v :
         {&q_, &dq_, &tau_, &ddq_, &ddq_used_, &p_, &u_, &noise_, &out_.dq, &out_.ddq, &out_.tau_model,
          &out_.tau_friction, &out_.tau_external, &out_.residual, &out_.external})
      *v = Vector::Zero(model.size());
    out_.contact = contact_.flags();
    out_.pushed = test_.contact();
    out_.tested = tunings_.front().tests;
    motion_.set_options(tunings_.front().motion);
  }

  int size() const noexcept { return n_; }  ///< n

  // What an empty TorqueEstimatorOptions::gain [1/s] and contact_threshold [N m] stand for.
  static constexpr double usual_gain = 60.0;
  static Vector usual_contact_threshold(const Vector& torque_limit) {
    Vector usual = Vector::Constant(torque_limit.size(), 2.0);
    for (Eigen::Index i = 0; i < usual.size(); ++i)
      if (std::isfinite(torque_limit[i])) usual[i] = 0.3 * std::sqrt(torque_limit[i]);
    return usual;
  }

  /// From another thread (one at a time): the loop uses `model` from its next cycle on. The residual goes on
  /// without a jump. Throws Error when it has another number of joints, or a payload or gravity
  /// that is not finite.
  void adopt(const TorqueModel<N>& model) {
    if (model.size() != n_) throw Error("the model has another number of joints than the estimator");
    if (!model.finite()) throw Error("the model's payload or gravity is not finite");
    models_.publish(model);
  }

  /// From the thread of adopt(): gain, contact_threshold, contact_release, acceleration_cutoff, uncertainty
  /// and test of `options` are in use from the next cycle on, the rest of it is not looked at. The residual
  /// goes on without a jump. Throws Error where the constructor does. Usual thresholds are those of the
  /// limits at the start.
  void retune(const TorqueEstimatorOptions& options) {
    TorqueEstimatorOptions others = options;
    others.order = options_.order;
    const Tuning next = tuning(limits_, others);
    // Their constructors know what is wrong.
    [[maybe_unused]] const MomentumObserver<N> observer(next.gain);
    [[maybe_unused]] const ContactDetector<N> detector(next.threshold, next.release);
    tunings_.publish(next);
  }

  /// One cycle, with the acceleration estimated from dq by a causal filter.
  ///
  /// dt [s]: time since the sample before, by the stamps of the samples; whatever it is for the first one.
  /// q [rad], dq [rad/s], tau [N m]: n, measured, any Eigen column expressions of double. Returns what is
  /// known now: valid until the next call; on bad_input and on a repeated sample, what was known before.
  template <class Q, class V, class T>
  const Estimate<N>& step(double dt, const Eigen::MatrixBase<Q>& q, const Eigen::MatrixBase<V>& dq,
                          const Eigen::MatrixBase<T>& tau) noexcept {
    return cycle(dt, q, dq, tau, static_cast<const Vector*>(nullptr));
  }
  /// The same with the desired acceleration ddq [rad/s^2] (n) for the model torque and tau_external.
  template <class Q, class V, class T, class A>
  const Estimate<N>& step(double dt, const Eigen::MatrixBase<Q>& q, const Eigen::MatrixBase<V>& dq,
                          const Eigen::MatrixBase<T>& tau, const Eigen::MatrixBase<A>& ddq) noexcept {
    return cycle(dt, q, dq, tau, &ddq);
  }

  /// Forgets the past: the next sample is the first one. For the thread of step().
  void reset() noexcept {
    started_ = false;
    elapsed_ = 0.0;
    contact_.reset();
    test_.reset();
  }

  const Estimate<N>& estimate() const noexcept { return out_; }             ///< of the last cycle
  const TorqueModel<N>& model() const noexcept { return models_.front(); }  ///< in use; thread of step()

 private:
  // An input beyond these means nothing: its magnitude, and how many times its limit.
  static constexpr double sense = 1e6, beyond = 10.0;
  static constexpr double shortest_dt = 1e-6;  // [s] less is no time at all

  static Vector over_joints(const Eigen::VectorXd& given, const Vector& usual, const char* what) {
    if (given.size() == 0) return usual;
    if (given.size() == 1) return Vector::Constant(usual.size(), given[0]);
    if (given.size() != usual.size()) throw Error(std::string(what) + ": one value, or one for each joint");
    return given;
  }
  static void positive(double x, const char* what) {
    if (!(x > 0.0) || !std::isfinite(x)) throw Error(std::string(what) + ": must be positive");
  }
  /// What retune() changes.
  struct Tuning {
    Vector gain, threshold, release;
    double cutoff;
    Vector drift;  ///< [(N m)^2/s] of ObserverOrder::kalman
    bool tests = false;
    MotionFilterOptions motion;
    typename ContactTest<N>::Tuning test;
  };
  static Tuning tuning(const Vector& torque_limit, const TorqueEstimatorOptions& options) {
    positive(options.acceleration_cutoff, "acceleration_cutoff");
    Tuning all;
    all.gain = over_joints(options.gain, Vector::Constant(torque_limit.size(), usual_gain), "gain");
    all.threshold =
        over_joints(options.contact_threshold, usual_contact_threshold(torque_limit), "contact_threshold");
    all.release = options.contact_release * all.threshold;
    all.cutoff = options.acceleration_cutoff;
    if (options.uncertainty) {
      all.tests = true;
      all.test = ContactTest<N>::make_tuning(*options.uncertainty, static_cast<int>(torque_limit.size()),
                                             options.test);
      all.motion = {options.uncertainty->motion_bandwidth, options.uncertainty->period,
                    options.uncertainty->position_noise};
      MotionFilter<N>::check(all.motion);
    }
    if (options.order == ObserverOrder::kalman) {
      if (!options.uncertainty) throw Error("a Kalman observer needs the model's uncertainty");
      all.drift.resize(all.gain.size());
      for (Eigen::Index i = 0; i < all.gain.size(); ++i)
        all.drift[i] = all.gain[i] * all.gain[i] * 2.0 / all.test.window *
                       all.test.joints[static_cast<std::size_t>(i)].constant;
    }
    return all;
  }

  // Copies a measured vector; false where a value means nothing.
  template <class X>
  bool take(const Eigen::MatrixBase<X>& x, Vector& to) const noexcept {
    if (x.size() != to.size()) return false;
    bool good = true;
    for (Eigen::Index i = 0; i < to.size(); ++i) {
      to[i] = x.coeff(i);
      good = good && std::abs(to[i]) < sense;  // false for a NaN
    }
    return good;
  }

  template <class Q, class V, class T, class A>
  const Estimate<N>& cycle(double dt, const Eigen::MatrixBase<Q>& q, const Eigen::MatrixBase<V>& dq,
                           const Eigen::MatrixBase<T>& tau, const A* ddq) noexcept {
    Status status = Status::ok;
    const bool changed = models_.update();
    if (changed) status |= Status::model_changed;
    const TorqueModel<N>& model = models_.front();
    if (tunings_.update()) {
      const Tuning& tuned = tunings_.front();
      observer_.set_gain(tuned.gain);
      contact_.set_thresholds(tuned.threshold, tuned.release);
      motion_.set_options(tuned.motion);
      if (tuned.tests != out_.tested) {
        // Another velocity is in use from here on.
        test_.reset(), out_.pushed = test_.contact();
        out_.tested = tuned.tests;
        dq_used_ = dq_;
        motion_.start(q_, dq_);
        if (started_) rebase(model);
      }
    }
    if (changed && started_) rebase(model);
    // Whatever else is wrong, time passes.
    if (started_) {
      if (!std::isfinite(dt)) {
        reset();  // how much time has passed is not known, and never will be
        return hold(status | Status::bad_input);
      }
      elapsed_ += dt;
      if (dt < 0.0) {
        status |= Status::time_went_back;
        reset();
      } else if (elapsed_ > options_.longest_dt) {
        status |= Status::gap;
        reset();
      }
    }
    // What is measured takes the place of the sample before only if all of it is good.
    bool good = take(q, next_q_) && take(dq, next_dq_) && take(tau, next_tau_);
    if (ddq != nullptr) good = good && take(*ddq, ddq_used_);
    for (Eigen::Index i = 0; i < next_q_.size(); ++i)
      good = good && std::abs(next_dq_[i]) <= beyond * model.velocity_limit()[i] &&
             std::abs(next_tau_[i]) <= beyond * model.torque_limit()[i];
    if (!good) return hold(status | Status::bad_input);
    if (started_) {
      if (elapsed_ < shortest_dt) return hold(status | Status::stale);
      if (next_q_ == q_ && next_dq_ == dq_ && next_tau_ == tau_) {
        status |= Status::stale;
        if (elapsed_ <= options_.bridge) return hold(status);
      }
    }
    double dt_used = elapsed_;
    if (!out_.tested) {
      estimate_acceleration();
      dq_used_ = next_dq_;
    } else {
      if (started_) {
        dt_used = motion_.elapsed(elapsed_, next_q_);
        if (!(dt_used > 0.0)) return hold(status | Status::stale);
        motion_.update(dt_used, next_q_, elapsed_);
      } else {
        motion_.start(next_q_, next_dq_);
      }
      ddq_ = motion_.acceleration(), dq_used_ = motion_.velocity();
    }
    q_ = next_q_, dq_ = next_dq_, tau_ = next_tau_;
    if (ddq == nullptr) ddq_used_ = ddq_;

    model.friction(q_, dq_used_, out_.tau_friction);
    model.torque(ws_, q_, dq_used_, ddq_used_, out_.tau_friction, out_.tau_model);
    model.momentum(ws_, q_, dq_used_, tau_, out_.tau_friction, p_, u_);
    if (started_) {
      if (options_.order == ObserverOrder::kalman)
        observer_.update(dt_used, p_, u_, tunings_.front().drift, noise());
      else
        observer_.update(dt_used, p_, u_);
    } else {
      observer_.start(p_, u_);
      status |= Status::restarted;
    }
    started_ = true;
    elapsed_ = 0.0;
    out_.dq = dq_used_, out_.ddq = ddq_used_;
    out_.residual = observer_.residual();
    for (Eigen::Index i = 0; i < q_.size(); ++i) out_.tau_external[i] = out_.tau_model[i] - tau_[i];
    out_.wrench = wrench_.update(model.rigid_body(), ws_, q_, out_.residual);
    out_.singular_margin = wrench_.margin();
    if (wrench_.near_singular()) status |= Status::near_singular;
    out_.contact = contact_.update(out_.residual);
    out_.external = observer_.external();
    if (tunings_.front().tests) test(has(status, Status::restarted) ? 0.0 : dt_used, model);
    for (Eigen::Index i = 0; i < q_.size(); ++i) {
      if (q_[i] < model.lower()[i] || q_[i] > model.upper()[i] ||
          std::abs(dq_[i]) > model.velocity_limit()[i] || std::abs(tau_[i]) > model.torque_limit()[i])
        status |= Status::limits_exceeded;
    }
    out_.status = status;
    return out_;
  }

  // Density of the noise that tau_ext is measured with: behind the window's low-pass it has sigma^2.
  const Vector& noise() noexcept {
    const auto& tuning = tunings_.front().test;
    for (Eigen::Index i = 0; i < q_.size(); ++i)
      noise_[i] =
          2.0 / tuning.window *
          tuning.joints[static_cast<std::size_t>(i)].variance(dq_used_[i], out_.tau_model[i], ddq_used_[i]);
    return noise_;
  }

  void test(double dt, const TorqueModel<N>& model) noexcept {
    const auto& tuning = tunings_.front().test;
    if (dt > 0.0 && test_.update(dt, out_.external, dq_used_, out_.tau_model, ddq_used_, tuning))
      test_.locate(dt, model.rigid_body(), ws_, wrench_.scaled_jacobian(), wrench_.length(),
                   wrench_.frame().translation(), tuning);
    out_.pushed = test_.contact();
  }

  const Estimate<N>& hold(Status status) noexcept {
    out_.status = status;
    return out_;
  }

  // p and u of the sample before by the model that is now in use.
  void rebase(const TorqueModel<N>& model) noexcept {
    model.friction(q_, dq_used_, out_.tau_friction);
    model.momentum(ws_, q_, dq_used_, tau_, out_.tau_friction, p_, u_);
    observer_.rebase(p_, u_);
  }

  void estimate_acceleration() noexcept {
    if (!started_) {
      ddq_.setZero();
      return;
    }
    // Exact answer of the filter to a dq that goes straight from one sample to the next.
    const double share = -std::expm1(-2.0 * M_PI * tunings_.front().cutoff * elapsed_);
    const double rate = 1.0 / elapsed_;
    for (Eigen::Index i = 0; i < ddq_.size(); ++i)
      ddq_[i] += share * ((next_dq_[i] - dq_[i]) * rate - ddq_[i]);
  }

  TripleBuffer<TorqueModel<N>> models_;
  Vector limits_;  // [N m] torque limits at the start
  TripleBuffer<Tuning> tunings_;
  Workspace<N> ws_;
  MomentumObserver<N> observer_;
  ContactDetector<N> contact_;
  ExternalWrench<N> wrench_;
  TorqueEstimatorOptions options_;
  MotionFilter<N> motion_;
  ContactTest<N> test_;
  int n_ = models_.front().size();
  bool started_ = false;
  double elapsed_ = 0.0;  // [s] since the sample before
  Vector q_, dq_, tau_;   // the sample before, as measured
  Vector next_q_ = Vector::Zero(n_), next_dq_ = next_q_, next_tau_ = next_q_;
  Vector dq_used_ = next_q_;  // as measured, or of the MotionFilter
  Vector ddq_;                // estimated acceleration
  Vector ddq_used_, p_, u_, noise_;
  Estimate<N> out_;
};

}  // namespace dynid
