// SPDX-License-Identifier: Apache-2.0
//
// A simulated arm that a ROS graph takes for a real one: joint states at 1 kHz of the wall clock, motions as
// trajectories, pushes as wrenches. See docs/nodes.md.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/WrenchStamped.h>
#include <pthread.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <tf2_ros/transform_broadcaster.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <ctime>
#include <memory>
#include <mutex>
#include <thread>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "ros/parameters.hpp"
#include "ros/plant_arm.hpp"
#include "ros/plant_clock.hpp"
#include "ros/plant_command.hpp"

namespace dynid {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

double now() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

void sleep_until(double instant) {
  timespec t;
  t.tv_sec = static_cast<time_t>(std::floor(instant));
  t.tv_nsec = static_cast<long>(1e9 * (instant - double(t.tv_sec)));
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
  }
}

/// Where the joints are when nothing else is said: the middle of their range, zero where they have none.
Eigen::VectorXd middle(const Robot& robot) {
  Eigen::VectorXd q(robot.size());
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const JointLimits& limits = robot.joints[static_cast<std::size_t>(j)].limits;
    const double centre = 0.5 * (limits.lower + limits.upper);
    q[j] = std::isfinite(centre) ? centre : 0.0;
  }
  return q;
}

class PlantNode {
 public:
  PlantNode();
  ~PlantNode();
  PlantNode(const PlantNode&) = delete;
  PlantNode& operator=(const PlantNode&) = delete;

  /// Until the node is shut down; true unless the arm was lost.
  bool run();

 private:
  Robot read_robot() const;
  PlantArm make_arm() const;
  void loop();
  void command(const trajectory_msgs::JointTrajectory::ConstPtr& message);
  void push(const geometry_msgs::WrenchStamped::ConstPtr& message);
  void diagnose(const ros::WallTimerEvent&);
  void publish_frames(const ros::WallTimerEvent&);

  ros::NodeHandle node_, private_{"~"};
  Parameters parameters_{private_};
  double period_, tolerance_;
  Robot robot_;

  std::mutex mutex_;  // of the arm and of the clock
  PlantArm arm_;
  PlantClock clock_;

  ros::Publisher joint_states_, executing_, diagnostics_;
  ros::Subscriber command_, push_;
  ros::WallTimer timer_, frames_timer_;
  Model<> model_;
  Workspace<> workspace_;
  std::unique_ptr<tf2_ros::TransformBroadcaster> frames_;
  std::atomic<bool> real_time_{false}, lost_{false}, end_{false};
  long executed_ = 0, refused_ = 0;
  std::thread thread_;
};

Robot PlantNode::read_robot() const {
  const std::string path = parameters_.required_text("model");
  std::vector<Inconsistency> broken;
  try {
    Robot robot = read_model_file(path, parameters_.text("base", ""), parameters_.text("tip", ""),
                                  Consistency::warn, &broken)
                      .robot;
    for (const Inconsistency& b : broken) ROS_WARN_STREAM(path << ": " << describe(b));
    return robot;
  } catch (const Error& error) {
    parameters_.refuse("model", error.what());
  }
}

PlantArm PlantNode::make_arm() const {
  PlantArmOptions options;
  std::vector<std::string> texts(1);  // one alone may stand without a list, as on a command line
  if (!private_.getParam("effects", texts[0])) texts = parameters_.texts("effects");
  for (const std::string& text : texts) {
    if (text.empty()) continue;  // an argument of a launch file that was left empty
    try {
      options.effects.push_back(parse_effect(text, robot_));
    } catch (const Error& error) {
      parameters_.refuse("effects", text + ": " + error.what());
    }
  }
  options.noise = parameters_.number("noise", options.noise, {0.0, 1000.0});
  options.spread = parameters_.number("spread", options.spread, {0.0, 0.49});
  options.seed = static_cast<unsigned long>(parameters_.number("seed", 1.0, {0.0, 4294967295.0}));
  options.period = period_;
  options.push_timeout = parameters_.number("push_timeout", options.push_timeout, {0.0, 3600.0, true});
  Eigen::VectorXd initial = parameters_.numbers("initial_position", robot_.size(), {-1e3, 1e3});
  if (initial.size() == 0) initial = middle(robot_);
  for (Eigen::Index j = 0; j < initial.size(); ++j) {
    const Joint& joint = robot_.joints[static_cast<std::size_t>(j)];
    if (!(initial[j] >= joint.limits.lower && initial[j] <= joint.limits.upper))
      parameters_.refuse("initial_position", "joint '" + joint.name + "': " + std::to_string(initial[j]) +
                                                 " is beyond the joint's limits");
  }
  try {
    return PlantArm(robot_, initial, options);
  } catch (const Error& error) {
    parameters_.refuse("effects", error.what());
  }
}

PlantNode::PlantNode()
    : period_(1.0 / parameters_.number("rate", 1000.0, {100.0, 2000.0})),
      tolerance_(parameters_.number("tolerance", 0.05, {0.0, 1.0, true})),
      robot_(read_robot()),
      arm_(make_arm()),
      clock_(period_, now()),
      model_(robot_),
      workspace_(model_) {
  joint_states_ = node_.advertise<sensor_msgs::JointState>("joint_states", 100);
  executing_ = private_.advertise<std_msgs::Bool>("executing", 10, true);
  diagnostics_ = node_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 1);
  const auto no_delay = ros::TransportHints().tcpNoDelay();
  command_ = private_.subscribe("command", 2, &PlantNode::command, this, no_delay);
  push_ = private_.subscribe("push", 10, &PlantNode::push, this, no_delay);
  timer_ = node_.createWallTimer(ros::WallDuration(1.0), &PlantNode::diagnose, this);
  if (parameters_.flag("publish_tf", false)) {
    frames_ = std::make_unique<tf2_ros::TransformBroadcaster>();
    frames_timer_ = node_.createWallTimer(ros::WallDuration(0.02), &PlantNode::publish_frames, this);
  }
}

PlantNode::~PlantNode() {
  end_ = true;
  if (thread_.joinable()) thread_.join();
}

bool PlantNode::run() {
  thread_ = std::thread(&PlantNode::loop, this);
  // The loop alone, and only where it is allowed.
  sched_param priority{};
  priority.sched_priority = 20;
  real_time_ = pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &priority) == 0;
  ROS_INFO_STREAM("simulated " << robot_.name << " at " << 1.0 / period_ << " Hz, "
                               << (real_time_ ? "SCHED_FIFO" : "without a real-time priority"));
  ros::spin();
  return !lost_;
}

void PlantNode::loop() {
  sensor_msgs::JointState state;
  for (const Joint& joint : robot_.joints) state.name.push_back(joint.name);
  for (std::vector<double>* values : {&state.position, &state.velocity, &state.effort})
    values->resize(state.name.size());
  const auto copy = [](const Eigen::VectorXd& from, std::vector<double>& to) {
    std::copy(from.begin(), from.end(), to.begin());
  };
  std_msgs::Bool executing;
  executing_.publish(executing);
  const auto offset = [] { return ros::WallTime::now().toSec() - now(); };
  double to_wall_clock = offset();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    clock_ = PlantClock(period_, now());
  }
  while (!end_ && ros::ok()) {
    sleep_until(clock_.wake());  // of the clock nothing but the statistics is touched by others
    bool moving;
    try {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (int k = clock_.begin(now()); k >= 0; --k) arm_.step();
      copy(arm_.plant().measured_q(), state.position);
      copy(arm_.plant().measured_dq(), state.velocity);
      copy(arm_.plant().measured_tau(), state.effort);
      moving = arm_.reference().moving();
    } catch (const Error& error) {
      ROS_FATAL_STREAM(error.what());
      lost_ = true;
      ros::requestShutdown();
      return;
    }
    // Stamps are even although cycles are not; a step of the system's clock is followed at once.
    if (std::abs(offset() - to_wall_clock) > 0.1) {
      const double again = offset();  // the first may have been interrupted between its two clocks
      if (std::abs(again - to_wall_clock) > 0.1) to_wall_clock = again;
    }
    state.header.stamp.fromSec(clock_.due() + to_wall_clock);
    joint_states_.publish(state);
    if (moving != bool(executing.data)) {
      executing.data = moving;
      executing_.publish(executing);
    }
  }
}

void PlantNode::command(const trajectory_msgs::JointTrajectory::ConstPtr& message) {
  if (message->points.empty()) {
    const std::lock_guard<std::mutex> lock(mutex_);
    arm_.stop();
    return;
  }
  try {
    Eigen::VectorXd held;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (arm_.reference().moving()) throw Error("the arm is moving; a command without points stops it");
      held = arm_.reference().held();
    }
    Trajectory motion = motion_from(*message, robot_, held, tolerance_);
    // Commands come one at a time, so that it still rests there.
    const double delay =
        message->header.stamp.isZero() ? 0.0 : message->header.stamp.toSec() - ros::WallTime::now().toSec();
    const double duration = motion.t[motion.samples() - 1];
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      arm_.begin(motion, std::max(0.0, delay));
    }
    ++executed_;
    ROS_INFO_STREAM("executing a motion of " << duration << " s");
  } catch (const Error& error) {
    ++refused_;
    ROS_WARN_STREAM(private_.resolveName("command") << " refused: " << error.what());
  }
}

void PlantNode::push(const geometry_msgs::WrenchStamped::ConstPtr& message) {
  std::string frame = message->header.frame_id;
  if (!frame.empty() && frame[0] == '/') frame.erase(0, 1);
  const geometry_msgs::Vector3 &f = message->wrench.force, &m = message->wrench.torque;
  const Vector6 wrench = (Vector6() << f.x, f.y, f.z, m.x, m.y, m.z).finished();
  const std::string topic = private_.resolveName("push");
  if (frame != robot_.base_link && frame != robot_.tip_link) {
    ROS_WARN_STREAM_THROTTLE(1.0, topic << " refused: frame '" << frame << "' is neither '"
                                        << robot_.base_link << "' nor '" << robot_.tip_link << "'");
  } else if (!(wrench.cwiseAbs().maxCoeff() <= 1000.0)) {
    ROS_WARN_STREAM_THROTTLE(1.0, topic << " refused: not finite, or beyond 1000 N or N m");
  } else {
    const std::lock_guard<std::mutex> lock(mutex_);
    arm_.push(wrench, frame == robot_.tip_link);
  }
}

void PlantNode::diagnose(const ros::WallTimerEvent&) {
  PlantClock::Statistics s;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    s = clock_.statistics();
    clock_.reset_statistics();
  }
  diagnostic_msgs::DiagnosticStatus status;
  status.name = ros::this_node::getName().substr(1) + ": loop";
  status.hardware_id = "simulated " + robot_.name;
  const bool behind = s.missed > 0 || s.stalls > 0;
  status.level = behind ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK;
  status.message = behind ? "the loop could not keep its rate" : "running";
  const auto add = [&status](const std::string& key, const std::string& value) {
    diagnostic_msgs::KeyValue pair;
    pair.key = key;
    pair.value = value;
    status.values.push_back(pair);
  };
  add("Cycles since the last message", std::to_string(s.cycles));
  add("Cycles late by more than a period", std::to_string(s.late));
  add("Cycles missed", std::to_string(s.missed));
  add("Stalls longer than 1 s", std::to_string(s.stalls));
  add("Latest start [ms]", std::to_string(1e3 * s.worst));
  add("Scheduling", real_time_ ? "SCHED_FIFO" : "normal");
  add("Motions executed", std::to_string(executed_));
  add("Commands refused", std::to_string(refused_));
  diagnostic_msgs::DiagnosticArray array;
  array.header.stamp = ros::Time::now();
  array.status.push_back(status);
  diagnostics_.publish(array);
}

void PlantNode::publish_frames(const ros::WallTimerEvent&) {
  Eigen::VectorXd q;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    q = arm_.plant().measured_q();
  }
  std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(robot_.size()) + 1);
  forward_kinematics(model_, workspace_, q, poses);
  std::vector<geometry_msgs::TransformStamped> transforms(poses.size());
  std::string parent = robot_.base_link;
  Eigen::Isometry3d in_parent = poses[0];
  for (std::size_t i = 0; i < poses.size(); ++i) {
    geometry_msgs::TransformStamped& t = transforms[i];
    t.header.stamp = ros::Time::now();
    t.header.frame_id = parent;
    t.child_frame_id = i < robot_.joints.size() ? robot_.joints[i].link_name : robot_.tip_link;
    if (i > 0) in_parent = poses[i - 1].inverse() * poses[i];
    const Eigen::Vector3d& at = in_parent.translation();
    const Eigen::Quaterniond turn(in_parent.linear());
    t.transform.translation.x = at.x(), t.transform.translation.y = at.y(),
    t.transform.translation.z = at.z();
    t.transform.rotation.x = turn.x(), t.transform.rotation.y = turn.y();
    t.transform.rotation.z = turn.z(), t.transform.rotation.w = turn.w();
    parent = t.child_frame_id;
  }
  frames_->sendTransform(transforms);
}

}  // namespace
}  // namespace dynid

int main(int argc, char** argv) {
  ros::init(argc, argv, "plant");
  const ros::NodeHandle handle;  // the last one to go takes ROS' logging with it
  try {
    dynid::PlantNode node;
    return node.run() ? 0 : 1;
  } catch (const dynid::Error& error) {
    ROS_FATAL_STREAM(error.what());
    return 2;
  }
}
