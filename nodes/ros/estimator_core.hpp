// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sensor_msgs/JointState.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "dynid/estimation/torque_estimator.hpp"
#include "ros/joint_map.hpp"
#include "ros/message_reading.hpp"
#include "ros/reading_watch.hpp"

namespace dynid {

/// Why a message is not answered; `none`: it is.
enum class Withheld : unsigned char {
  none,
  other_joints,    ///< not one of the robot's joints: not for us
  joint_missing,   ///< by name
  joint_twice,     ///< named twice
  incomplete,      ///< no position, velocity or effort for a joint
  no_stamp,        ///< a stamp of zero: no time, no dt
  bad_value,       ///< not a number, or far beyond a limit
  too_old,         ///< the stamp is longer ago than allowed, or ahead by as much
  repeated,        ///< no time has passed, or the sample is the one before over again
  time_went_back,  ///< the stamp is before the last one: everything starts anew
  gap,             ///< more time has passed than a filter can span: everything starts anew
  settling,        ///< after a start: the filters do not know yet
};
inline constexpr std::size_t withheld_count = static_cast<std::size_t>(Withheld::settling) + 1;
const char* describe(Withheld why) noexcept;

/// Where the external wrench is wanted: about the origin of a frame and in its axes.
struct WrenchFrame {
  bool known = true;
  int link = 0;  ///< that carries the frame: -1 the base, 0..n-1 the links, n the tip
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< in that link's frame
};

/// What a message is answered with; valid until the next one.
struct EstimatorAnswer {
  Withheld withheld = Withheld::none;
  int joint = -1;  ///< that `withheld` is about, from 0; -1: none
  Status status = Status::ok;
  const Estimate<>* estimate = nullptr;  ///< never null after handle()
  bool has_wrench = false;  ///< the frame is known, and the arm not near a singularity (or that was allowed)
  Eigen::Matrix<double, 6, 1> wrench = Eigen::Matrix<double, 6, 1>::Zero();  ///< force [N], moment [N m]
  bool has_push = false;  ///< the contact test sees one, and the frame is known
  /// Of the push, about the frame's origin and in its axes, with its covariance.
  Eigen::Matrix<double, 6, 1> push = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> push_covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// What the messages were like, for the diagnostics. Counts are from the start.
struct EstimatorRecord {
  std::uint64_t messages = 0, answered = 0, dropped = 0, starts = 0, near_singular = 0, beyond_limits = 0;
  std::array<std::uint64_t, withheld_count> withheld = {};
  Withheld last_withheld = Withheld::none;
  int last_joint = -1;
  Status last_status = Status::ok;
  /// Of the time between stamps [s] and of handle() [s], since renew().
  struct Window {
    std::uint64_t steps = 0;
    double sum = 0.0, sum_of_squares = 0.0, longest = 0.0, worst_compute = 0.0, oldest = 0.0;
  } window;
  double worst_compute = 0.0;  ///< [s] ever
  Eigen::VectorXd rest;        ///< [N m] residual at rest, low-passed over a second of rest; n
  double rest_time = 0.0;      ///< [s] for which the arm rests; 0 while it moves
  bool contact = false;
};

struct EstimatorCoreOptions {
  TorqueEstimatorOptions estimator;
  MessageReading reading;                  ///< of the messages, before anything else
  bool zero_acceleration = false;          ///< in place of the estimated one
  double longest_age = 0.5;                ///< [s] of a message, 0: any
  bool wrench_near_singularities = false;  ///< give it, damped, there too
};

/// A stream of joint states in, estimates out: torque_estimator_node without ROS's machinery.
///
/// handle() and everything that it returns are for one thread; it does not throw, and allocates only where
/// the names of a message differ from those of the message before. The rest may be called from one other
/// thread at any time without delaying it.
class EstimatorCore {
 public:
  /// `joints`: the model's, base to tip, as the messages name them. Throws Error where TorqueEstimator does.
  EstimatorCore(const TorqueModel<>& model, std::vector<std::string> joints,
                const EstimatorCoreOptions& options);

  /// `now` [s]: on the clock of the stamps; 0: that clock does not run yet.
  const EstimatorAnswer& handle(const sensor_msgs::JointState& message, double now) noexcept;

  // From the other thread.
  void adopt(const TorqueModel<>& model) { estimator_.adopt(model); }  ///< throws Error
  void retune(const TorqueEstimatorOptions& options);                  ///< throws Error
  void set_wrench_frame(const WrenchFrame& frame) { frames_.publish(frame); }
  void reset() noexcept { reset_.store(true, std::memory_order_release); }  ///< before the next message
  /// The newest record. Its window is renewed after the next message.
  const EstimatorRecord& record() noexcept;
  /// The newest message that had all joints, as it stands; null where there was none since the last call.
  const JointSample* sample() noexcept;

  const std::vector<std::string>& joints() const noexcept { return map_.joints(); }

 private:
  void answer(const sensor_msgs::JointState& message, double now) noexcept;
  void withhold(Withheld why, int joint = -1) noexcept;
  void express_wrench(bool wrench) noexcept;
  void watch_rest(double dt) noexcept;
  static double settling_time(const TorqueEstimatorOptions& options);

  JointMap map_;
  Eigen::VectorXd q_, dq_, tau_, gravity_;  // of the message, as they are read
  EstimatorCoreOptions options_;
  TorqueEstimator<> estimator_;
  Workspace<> ws_;
  std::vector<Eigen::Isometry3d> poses_;
  Eigen::VectorXd no_acceleration_;
  TripleBuffer<WrenchFrame> frames_;
  TripleBuffer<EstimatorRecord> records_;
  TripleBuffer<JointSample> samples_;
  std::atomic<bool> reset_{false}, renew_{false};
  std::atomic<double> settling_;  // [s]

  EstimatorAnswer answer_;
  EstimatorRecord record_;
  JointSample sample_;
  bool started_ = false;      // last_time_ is known
  ros::Time last_time_;       // stamp of the last message that reached the estimator
  double since_start_ = 0.0;  // [s] since the estimator last started
  std::uint32_t last_sequence_ = 0;
};

}  // namespace dynid
