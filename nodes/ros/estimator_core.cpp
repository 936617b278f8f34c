// SPDX-License-Identifier: Apache-2.0
#include "ros/estimator_core.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "dynid/dynamics/gravity.hpp"
#include "dynid/dynamics/kinematics.hpp"

namespace dynid {

namespace {

constexpr double at_rest = 0.01;                // [rad/s] a joint slower than this rests
constexpr double rest_constant = 1.0;           // [s] of the low-pass over a rest
constexpr std::uint32_t most_dropped = 100000;  // a leap beyond is another publisher

// ros::Time's own difference throws where it does not fit into a ros::Duration.
double seconds_between(const ros::Time& from, const ros::Time& to) noexcept {
  return (static_cast<double>(to.sec) - static_cast<double>(from.sec)) +
         1e-9 * (static_cast<double>(to.nsec) - static_cast<double>(from.nsec));
}

int first_not_finite(const Eigen::VectorXd& x) noexcept {
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (!std::isfinite(x[i])) return static_cast<int>(i);
  return -1;
}

}  // namespace

const char* describe(Withheld why) noexcept {
  switch (why) {
    case Withheld::none:
      return "answered";
    case Withheld::other_joints:
      return "other joints";
    case Withheld::joint_missing:
      return "joint missing";
    case Withheld::joint_twice:
      return "joint named twice";
    case Withheld::incomplete:
      return "no position, velocity or effort";
    case Withheld::no_stamp:
      return "no stamp";
    case Withheld::bad_value:
      return "not a number, or far beyond a limit";
    case Withheld::too_old:
      return "stamp too far from now";
    case Withheld::repeated:
      return "sample repeated";
    case Withheld::time_went_back:
      return "time went back";
    case Withheld::gap:
      return "gap in time";
    case Withheld::settling:
      return "settling after a start";
  }
  return "";
}

double EstimatorCore::settling_time(const TorqueEstimatorOptions& options) {
  double slowest = options.gain.size() > 0 ? options.gain.minCoeff() : TorqueEstimator<>::usual_gain;
  if (options.order == ObserverOrder::second)
    slowest *= std::min(1.0, 2.0 * options.damping * options.damping);
  return 5.0 / std::min(slowest, 2.0 * M_PI * options.acceleration_cutoff);
}

EstimatorCore::EstimatorCore(const TorqueModel<>& model, std::vector<std::string> joints,
                             const EstimatorCoreOptions& options)
    : map_(std::move(joints)),
      q_(Eigen::VectorXd::Zero(model.size())),
      dq_(q_),
      tau_(q_),
      gravity_(q_),
      options_(options),
      estimator_(model, options.estimator),
      ws_(model.rigid_body()),
      poses_(static_cast<std::size_t>(model.size()) + 1),
      no_acceleration_(Eigen::VectorXd::Zero(model.size())),
      frames_(WrenchFrame{true, model.size(), Eigen::Isometry3d::Identity()}),
      records_([&] {
        EstimatorRecord first;
        first.rest = Eigen::VectorXd::Zero(model.size());
        return first;
      }()),
      samples_(JointSample{0.0, q_, q_, q_}),
      settling_(settling_time(options.estimator)),
      record_(records_.front()),
      sample_(samples_.front()) {
  if (map_.size() != model.size())
    throw Error("the model has " + std::to_string(model.size()) + " joints, and " +
                std::to_string(map_.size()) + " names are given");
  answer_.estimate = &estimator_.estimate();
}

void EstimatorCore::retune(const TorqueEstimatorOptions& options) {
  estimator_.retune(options);
  settling_.store(settling_time(options), std::memory_order_relaxed);
}

const EstimatorRecord& EstimatorCore::record() noexcept {
  records_.update();
  renew_.store(true, std::memory_order_relaxed);
  return records_.front();
}

const JointSample* EstimatorCore::sample() noexcept {
  return samples_.update() ? &samples_.front() : nullptr;
}

const EstimatorAnswer& EstimatorCore::handle(const sensor_msgs::JointState& message, double now) noexcept {
  const auto begin = std::chrono::steady_clock::now();
  if (renew_.exchange(false, std::memory_order_relaxed)) record_.window = {};
  if (reset_.exchange(false, std::memory_order_acquire)) {
    estimator_.reset();
    started_ = false;
  }
  answer_.withheld = Withheld::none;
  answer_.joint = -1;
  answer_.status = Status::ok;
  answer_.has_wrench = false;
  answer_.has_push = false;
  answer(message, now);

  if (answer_.withheld == Withheld::none) {
    ++record_.answered;
  } else {
    ++record_.withheld[static_cast<std::size_t>(answer_.withheld)];
    if (answer_.withheld != Withheld::other_joints) {
      record_.last_withheld = answer_.withheld;
      record_.last_joint = answer_.joint;
    }
  }
  if (answer_.withheld != Withheld::other_joints) record_.last_status = answer_.status;
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  record_.window.worst_compute = std::max(record_.window.worst_compute, taken.count());
  record_.worst_compute = std::max(record_.worst_compute, taken.count());
  records_.publish(record_);
  return answer_;
}

void EstimatorCore::withhold(Withheld why, int joint) noexcept {
  answer_.withheld = why;
  answer_.joint = joint;
}

void EstimatorCore::answer(const sensor_msgs::JointState& message, double now) noexcept {
  const JointMap::Found found = map_.read(message);
  if (found == JointMap::Found::none) return withhold(Withheld::other_joints);
  ++record_.messages;
  const std::uint32_t leap = message.header.seq - last_sequence_;  // wraps around as the sequence does
  if (record_.messages > 1 && leap > 1 && leap < most_dropped) record_.dropped += leap - 1;
  last_sequence_ = message.header.seq;
  switch (found) {
    case JointMap::Found::missing:
      return withhold(Withheld::joint_missing, map_.joint());
    case JointMap::Found::twice:
      return withhold(Withheld::joint_twice, map_.joint());
    case JointMap::Found::incomplete:
      return withhold(Withheld::incomplete, map_.joint());
    default:
      break;
  }
  const ros::Time& stamp = message.header.stamp;
  if (stamp.isZero()) return withhold(Withheld::no_stamp);

  q_ = map_.q(), dq_ = map_.dq(), tau_ = map_.tau();
  sample_.t = stamp.toSec();
  sample_.q = q_, sample_.dq = dq_, sample_.tau = tau_;
  samples_.publish(sample_);
  options_.reading.apply(q_, dq_, tau_);
  if (options_.reading.without_gravity()) {
    gravity(estimator_.model().rigid_body(), ws_, q_, gravity_);
    tau_ += gravity_;
  }

  const double dt = started_ ? seconds_between(last_time_, stamp) : 0.0;
  started_ = true;
  last_time_ = stamp;
  const Estimate<>& estimate = options_.zero_acceleration
                                   ? estimator_.step(dt, q_, dq_, tau_, no_acceleration_)
                                   : estimator_.step(dt, q_, dq_, tau_);
  const Status status = answer_.status = estimate.status;
  EstimatorRecord::Window& window = record_.window;
  if (dt > 0.0 && !has(status, Status::gap)) {
    ++window.steps;
    window.sum += dt;
    window.sum_of_squares += dt * dt;
    window.longest = std::max(window.longest, dt);
  }
  since_start_ += std::max(dt, 0.0);
  if (has(status, Status::restarted)) {
    since_start_ = 0.0;
    ++record_.starts;
  }
  const double age = now > 0.0 ? now - stamp.toSec() : 0.0;
  window.oldest = std::max(window.oldest, age);

  if (has(status, Status::bad_input)) {
    int joint = first_not_finite(q_);
    if (joint < 0) joint = first_not_finite(dq_);
    if (joint < 0) joint = first_not_finite(tau_);
    return withhold(Withheld::bad_value, joint);
  }
  if (has(status, Status::time_went_back)) return withhold(Withheld::time_went_back);
  if (has(status, Status::gap)) return withhold(Withheld::gap);
  if (has(status, Status::stale)) return withhold(Withheld::repeated);
  if (options_.longest_age > 0.0 && !(std::abs(age) <= options_.longest_age))
    return withhold(Withheld::too_old);
  if (since_start_ < settling_.load(std::memory_order_relaxed)) return withhold(Withheld::settling);

  if (has(status, Status::limits_exceeded)) ++record_.beyond_limits;
  if (has(status, Status::near_singular)) ++record_.near_singular;
  record_.contact = estimate.tested ? estimate.pushed.detected : estimate.contact.any();
  watch_rest(dt);
  const bool wrench = options_.wrench_near_singularities || !has(status, Status::near_singular);
  if (wrench || estimate.pushed.detected) express_wrench(wrench);
}

// The estimator's wrenches are about the tip and in the axes of the base.
void EstimatorCore::express_wrench(bool wrench) noexcept {
  frames_.update();
  const WrenchFrame& frame = frames_.front();
  if (!frame.known) return;
  forward_kinematics(estimator_.model().rigid_body(), ws_, q_, poses_);
  const Eigen::Isometry3d pose =
      frame.link < 0 ? frame.pose : poses_[static_cast<std::size_t>(frame.link)] * frame.pose;
  const Eigen::Vector3d arm = poses_.back().translation() - pose.translation();
  const Eigen::Matrix3d turn = pose.linear().transpose();
  Eigen::Matrix3d lever;  // times a vector: arm x vector
  lever << 0.0, -arm.z(), arm.y(), arm.z(), 0.0, -arm.x(), -arm.y(), arm.x(), 0.0;
  Eigen::Matrix<double, 6, 6> to_frame = Eigen::Matrix<double, 6, 6>::Zero();
  to_frame.topLeftCorner<3, 3>() = to_frame.bottomRightCorner<3, 3>() = turn;
  to_frame.bottomLeftCorner<3, 3>().noalias() = turn * lever;
  const Estimate<>& estimate = estimator_.estimate();
  if (wrench) answer_.wrench.noalias() = to_frame * estimate.wrench;
  answer_.has_wrench = wrench;
  if (!estimate.pushed.detected) return;
  answer_.push.noalias() = to_frame * estimate.pushed.wrench;
  answer_.push_covariance.noalias() = to_frame * estimate.pushed.covariance * to_frame.transpose();
  answer_.has_push = true;
}

void EstimatorCore::watch_rest(double dt) noexcept {
  if (!(dq_.cwiseAbs().maxCoeff() < at_rest)) {
    record_.rest_time = 0.0;
    return;
  }
  const Eigen::VectorXd& r = estimator_.estimate().residual;
  const double share = record_.rest_time > 0.0 ? -std::expm1(-dt / rest_constant) : 1.0;
  for (Eigen::Index i = 0; i < r.size(); ++i) record_.rest[i] += share * (r[i] - record_.rest[i]);
  record_.rest_time += dt;
}

}  // namespace dynid
