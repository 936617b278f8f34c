// SPDX-License-Identifier: Apache-2.0
//
// Records a robot's joint states, by itself or while it has the robot make an exciting motion, and
// identifies, retrieves and diagnoses what they say as the program `dynid` does; or does so with a bag,
// without a roscore. See docs/nodes.md.
#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float32.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>

#include "dynid/base/error.hpp"
#include "dynid/base/text.hpp"
#include "dynid/model/robot_file.hpp"
#include "ros/bag.hpp"
#include "ros/command_recording.hpp"
#include "ros/exciting_command.hpp"
#include "ros/identification_run.hpp"
#include "ros/identification_settings.hpp"
#include "ros/parameters.hpp"
#include "ros/recording.hpp"

namespace dynid {
namespace {

using Texts = std::map<std::string, std::string>;

std::atomic<bool> end_requested{false};
extern "C" void on_signal(int) { end_requested = true; }

/// What is no option of the use cases: the node's own.
const std::set<std::string>& own_parameters() {
  static const std::set<std::string> names = {"move_robot",
                                              "i_confirm_the_robot_may_move",
                                              "trajectory",
                                              "duration",
                                              "timeout",
                                              "approach_velocity",
                                              "tracking_tolerance",
                                              "auto",
                                              "auto_adopt",
                                              "estimator",
                                              "bag"};
  return names;
}

// ------------------------------------------------------------------------------------------------ on a bag

/// Settings of the parameters; `unknown` are those that are neither theirs nor the node's own.
IdentificationSettings settings_of(const Texts& texts, std::vector<std::string>& unknown) {
  std::vector<std::string> unread;
  IdentificationSettings settings = identification_settings(texts, unread);
  for (const std::string& name : unread)
    if (own_parameters().count(name) == 0) unknown.push_back(name);
  return settings;
}

/// Exit status as the program's.
int identify_bag(const Texts& texts) {
  try {
    std::vector<std::string> unknown;
    const IdentificationSettings settings = settings_of(texts, unknown);
    if (settings.model.empty()) throw Error("the parameter ~model is required: the robot's model");
    if (!unknown.empty()) throw Error("~" + unknown.front() + ": is not a parameter of this node");
    Context context;
    context.stop = &end_requested;
    const nlohmann::json result = identify_log(settings, texts.at("bag"), context, &std::cout);
    std::cout << "All of it is in " << file_in_folder(settings, "result.json") << std::endl;
    return result["status"];
  } catch (const Stopped&) {
    std::cerr << "identification_node: interrupted" << std::endl;
    return 128 + SIGINT;
  } catch (const std::exception& error) {
    std::cerr << "identification_node: " << one_line(error.what()) << std::endl;
    return 2;
  }
}

/// Private parameters of the command line, `_name:=value`, and what stands for joint_states, as `topic`.
Texts command_line(int argc, char** argv) {
  Texts options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const std::size_t at = word.find(":=");
    if (at == std::string::npos || at == 0) continue;
    const std::string name = word.substr(0, at), value = word.substr(at + 2);
    if (value.empty()) continue;
    if (name[0] == '_' && name[1] != '_') options[name.substr(1)] = value;
    if (name == "joint_states") options.emplace("topic", value);
  }
  return options;
}

/// As text, whatever its type; empty for groups.
std::string text_of(XmlRpc::XmlRpcValue value) {
  std::ostringstream text;
  text.precision(17);
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return bool(value) ? "true" : "false";
    case XmlRpc::XmlRpcValue::TypeInt:
      text << int(value);
      break;
    case XmlRpc::XmlRpcValue::TypeDouble:
      text << double(value);
      break;
    case XmlRpc::XmlRpcValue::TypeString:
      return std::string(value);
    case XmlRpc::XmlRpcValue::TypeArray:  // `[x, y, z]`; TextParameters says what is wrong with others
      for (int i = 0; i < value.size(); ++i) text << (i == 0 ? "[" : ",") << text_of(value[i]);
      return value.size() > 0 ? text.str() + "]" : "";
    default:
      break;
  }
  return text.str();
}

/// The node's private parameters on the server, but for those that are empty: arguments of a launch file.
Texts on_server(const ros::NodeHandle& node) {
  Texts options;
  XmlRpc::XmlRpcValue all;
  if (!node.getParam("", all) || all.getType() != XmlRpc::XmlRpcValue::TypeStruct) return options;
  for (auto& [name, value] : all) {
    const std::string text = text_of(value);
    if (!text.empty()) options[name] = text;
  }
  return options;
}

// ------------------------------------------------------------------------------------------------- on a
// robot

class IdentificationNode {
 public:
  IdentificationNode();
  ~IdentificationNode();
  void spin();

 private:
  enum class State { idle, preparing, moving, recording, saving, identifying };
  static const char* name(State state);

  IdentificationSettings settings(std::vector<std::string>* unknown = nullptr) const;
  Context context();
  /// Its work goes on in the background, in `state`; the mutex is held.
  void work(State state, std::function<void()> job);
  void say(const std::string& line);
  void fail(const std::string& why);

  // Services: what they answer, or an Error.
  std::string start();
  std::string stop();
  std::string identify();
  std::string adopt();
  void serve(const std::string& name, std::string (IdentificationNode::*what)());

  void tick();
  void diagnose_reading(diagnostic_updater::DiagnosticStatusWrapper& status);
  void watch_recording();
  /// Ends the recording and saves it; `trouble` is why it ended before its time. The mutex is held.
  void end_recording(const std::string& trouble);
  // In the background:
  void prepare();
  void save(const std::string& ended);  // `ended`: why before its time
  void run();

  ros::NodeHandle node_, private_{"~"};
  Parameters parameters_{private_};
  std::string model_, topic_, command_topic_;  // no command topic: none is recorded
  Robot robot_;
  double timeout_, duration_, tolerance_;
  ros::Publisher command_, progress_, fraction_, result_publisher_;
  std::vector<ros::ServiceServer> services_;
  ros::CallbackQueue states_queue_;  // of its own: no service keeps a message waiting
  ros::Subscriber states_, commands_;
  ros::AsyncSpinner states_spinner_{1, &states_queue_};
  ros::SteadyTimer timer_;
  diagnostic_updater::Updater updater_;

  std::mutex mutex_;  // of what follows
  std::atomic<State> state_{State::idle};
  std::unique_ptr<JointRecording> recording_;  // has a mutex of its own
  CommandRecording commanding_;                // so has this
  double told_duration_ = -1.0;                // [s] of the recording, as it was said last
  std::size_t told_messages_ = 0;
  std::string bag_;  // what was recorded; empty: nothing
  Trajectory motion_;
  ros::Time commanded_;  // stamp of the last state before the command
  bool identify_next_ = false, adopt_next_ = false, waiting_to_start_ = false;
  nlohmann::json result_;
  std::string misread_;  // how the last log is to be read; empty: as it stands
  std::string last_line_;
  std::thread worker_;
  std::atomic<bool> cancel_{false};
};

const char* IdentificationNode::name(State state) {
  switch (state) {
    case State::preparing:
      return "preparing";
    case State::moving:
      return "moving";
    case State::recording:
      return "recording";
    case State::saving:
      return "saving";
    case State::identifying:
      return "identifying";
    case State::idle:
      break;
  }
  return "idle";
}

IdentificationNode::IdentificationNode() {
  const Parameters::Range positive{0.0, 86400.0, true};
  model_ = parameters_.required_text("model");
  try {
    robot_ =
        read_robot(model_, parameters_.text("base", ""), parameters_.text("tip", ""), Consistency::ignore);
  } catch (const Error& error) {
    parameters_.refuse("model", error.what());
  }
  const Eigen::VectorXd gravity = parameters_.numbers("gravity", 3, {-100.0, 100.0});
  if (gravity.size() == 3) robot_.gravity = gravity;
  timeout_ = parameters_.number("timeout", 1.0, positive);
  duration_ = parameters_.number("duration", 600.0, positive);
  tolerance_ = parameters_.number("tracking_tolerance", 0.3, positive);
  parameters_.number("approach_velocity", 0.1, {0.0, 1.0, true});
  waiting_to_start_ = parameters_.flag("auto", false);
  topic_ = node_.resolveName("joint_states");
  std::vector<std::string> unknown;
  command_topic_ = settings(&unknown).command_topic;  // what is wrong with them is said now
  if (!command_topic_.empty()) command_topic_ = node_.resolveName(command_topic_);
  for (const std::string& name : unknown)
    ROS_WARN_STREAM(parameters_.full(name) << " is not a parameter of this node");

  std::vector<std::string> joints;
  for (const Joint& joint : robot_.joints) joints.push_back(joint.name);
  recording_ = std::make_unique<JointRecording>(joints);
  command_ = private_.advertise<trajectory_msgs::JointTrajectory>("command", 1);
  progress_ = private_.advertise<std_msgs::String>("progress", 10, true);
  fraction_ = private_.advertise<std_msgs::Float32>("progress_fraction", 10, true);
  result_publisher_ = private_.advertise<std_msgs::String>("result", 1, true);
  serve("start", &IdentificationNode::start);
  serve("stop", &IdentificationNode::stop);
  serve("identify", &IdentificationNode::identify);
  serve("adopt", &IdentificationNode::adopt);
  auto options = ros::SubscribeOptions::create<sensor_msgs::JointState>(
      "joint_states", 1000,
      [this](const sensor_msgs::JointState::ConstPtr& m) { recording_->add(*m, ros::Time::now()); }, nullptr,
      &states_queue_);
  options.transport_hints = ros::TransportHints().tcpNoDelay();
  states_ = node_.subscribe(options);
  if (!command_topic_.empty()) {
    auto commands = ros::SubscribeOptions::create<AnyMessage>(
        command_topic_, 1000,
        [this](const boost::shared_ptr<AnyMessage const>& m) { commanding_.add(*m, ros::Time::now()); },
        nullptr, &states_queue_);
    commands.transport_hints = ros::TransportHints().tcpNoDelay();
    commands_ = node_.subscribe(commands);
  }
  states_spinner_.start();
  updater_.setHardwareID(robot_.name);
  updater_.add("log", this, &IdentificationNode::diagnose_reading);
  timer_ = node_.createSteadyTimer(ros::WallDuration(0.05), [this](const ros::SteadyTimerEvent&) { tick(); });
  say("idle: waiting for ~start");
}

IdentificationNode::~IdentificationNode() {
  cancel_ = true;
  if (worker_.joinable()) worker_.join();
  states_spinner_.stop();
}

void IdentificationNode::spin() {
  while (ros::ok() && !end_requested) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  bool moving = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    moving = state_ == State::moving;
    cancel_ = true;
  }
  if (!moving || !ros::ok()) return;
  command_.publish(trajectory_msgs::JointTrajectory());  // a command without points stops the arm
  ros::WallDuration(0.3).sleep();                        // for it to leave
}

IdentificationSettings IdentificationNode::settings(std::vector<std::string>* unknown) const {
  Texts texts = on_server(private_);
  texts["model"] = model_;
  texts["topic"] = topic_;
  if (!command_topic_.empty()) texts["command_topic"] = command_topic_;
  std::vector<std::string> ignored;
  return settings_of(texts, unknown != nullptr ? *unknown : ignored);
}

Context IdentificationNode::context() {
  Context context;
  context.stop = &cancel_;
  context.progress = [this](const std::string& stage, double fraction) {
    std_msgs::Float32 message;
    message.data = static_cast<float>(fraction);
    fraction_.publish(message);
    say(std::string(name(state_)) + ": " + stage);
  };
  return context;
}

void IdentificationNode::say(const std::string& line) {
  static std::mutex of_line;
  const std::lock_guard<std::mutex> lock(of_line);
  if (line == last_line_) return;
  last_line_ = line;
  std_msgs::String message;
  message.data = line;
  progress_.publish(message);
}

void IdentificationNode::fail(const std::string& why) {
  ROS_ERROR_STREAM(why);
  say("failed: " + why);
  const nlohmann::json failed = {{"status", 2}, {"error", why}, {"adoptable", ""}};
  std_msgs::String message;
  message.data = failed.dump();
  result_publisher_.publish(message);
}

void IdentificationNode::work(State state, std::function<void()> job) {
  if (worker_.joinable()) worker_.join();  // it has ended: the state was idle, or the job ends with this call
  state_ = state;
  cancel_ = false;
  worker_ = std::thread([this, job = std::move(job)] {
    std::string trouble;
    try {
      job();
      return;
    } catch (const std::exception& error) {
      trouble = one_line(error.what());
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    identify_next_ = false;
    state_ = State::idle;
    if (cancel_) {
      say("idle: cancelled");
    } else {
      fail(trouble);
    }
  });
}

void IdentificationNode::serve(const std::string& name, std::string (IdentificationNode::*what)()) {
  using Trigger = std_srvs::Trigger;
  const boost::function<bool(Trigger::Request&, Trigger::Response&)> answer =
      [this, what](Trigger::Request&, Trigger::Response& response) {
        try {
          response.message = (this->*what)();
          response.success = true;
        } catch (const std::exception& error) {
          response.message = one_line(error.what());
          response.success = false;
        }
        return true;
      };
  services_.push_back(private_.advertiseService(name, answer));
}

std::string IdentificationNode::start() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (state_ != State::idle) throw Error(std::string("not now: ") + name(state_));
  const bool move = parameters_.flag("move_robot", false);
  if (move && !parameters_.flag("i_confirm_the_robot_may_move", false))
    throw Error(
        parameters_.full("i_confirm_the_robot_may_move") +
        " is not true: the robot is not moved. Set it once the way is clear and a hand is on the stop");
  identify_next_ = false;
  result_ = nullptr;
  if (move) {
    say("preparing: the motion");
    work(State::preparing, [this] { prepare(); });
    return "preparing the motion, then the robot moves";
  }
  recording_->start();
  commanding_.start();
  bag_.clear();
  state_ = State::recording;
  const std::string what = topic_ + (command_topic_.empty() ? "" : " and " + command_topic_);
  say("recording: waiting for " + what);
  return "recording " + what + " until ~stop, " + std::to_string(std::lround(duration_)) + " s at most";
}

std::string IdentificationNode::stop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  waiting_to_start_ = false;
  switch (state_) {
    case State::idle:
      throw Error("nothing to stop");
    case State::moving:
      command_.publish(trajectory_msgs::JointTrajectory());
      end_recording("");
      return "the robot is stopped";
    case State::recording:
      end_recording("");
      return "recorded " + std::to_string(recording_->summary().messages) + " messages";
    case State::preparing:
    case State::saving:
    case State::identifying:
      break;
  }
  cancel_ = true;
  identify_next_ = false;
  return std::string("ending: ") + name(state_);
}

std::string IdentificationNode::identify() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (state_ == State::recording && recording_->summary().messages > 0) end_recording("");
  if (state_ == State::saving) {
    identify_next_ = true;
    return "identifying once the recording is saved";
  }
  if (state_ != State::idle) throw Error(std::string("not now: ") + name(state_));
  if (bag_.empty()) throw Error("nothing was recorded: ~start first");
  say("identifying: reading " + bag_);
  work(State::identifying, [this] { run(); });
  return "identifying " + bag_;
}

std::string IdentificationNode::adopt() {
  std::string model;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (state_ == State::identifying) throw Error("not now: identifying");
    if (!misread_.empty()) throw Error("not from a log that is misread: " + misread_);
    if (result_.is_object()) model = result_.value("adoptable", "");
  }
  if (model.empty()) throw Error("there is no identified model to adopt: ~identify first");
  const std::string estimator = parameters_.text("estimator", "/torque_estimator");
  const std::string parameter = estimator + "/model", service = estimator + "/load_parameters";
  if (!ros::service::waitForService(service, ros::Duration(2.0))) throw Error(service + " is not there");
  // The estimator may run elsewhere, and in another folder.
  model = std::filesystem::absolute(model).lexically_normal().string();
  std::string before;
  const bool had = ros::param::get(parameter, before);
  ros::param::set(parameter, model);
  std_srvs::Trigger load;
  if (!ros::service::call(service, load) || !load.response.success) {
    if (had) {
      ros::param::set(parameter, before);
    } else {
      ros::param::del(parameter);
    }
    throw Error(service + ": " + (load.response.message.empty() ? "did not answer" : load.response.message));
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  result_["adopted"] = model;
  std_msgs::String message;
  message.data = result_.dump();
  result_publisher_.publish(message);
  say("done: " + estimator + " has adopted " + model);
  const bool feasible =
      result_["files"].contains("feasible") || result_["identification"]["physically_consistent"];
  return estimator + " has adopted " + model +
         (feasible ? "" : " (its links are not physically consistent: give ~bounds to have that)");
}

void IdentificationNode::tick() {
  updater_.update();  // at its own period
  bool start_now = false, adopt_now = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (state_ == State::recording || state_ == State::moving) watch_recording();
    if (state_ == State::idle) {
      start_now = waiting_to_start_ && recording_->pose().known;
      adopt_now = adopt_next_;
      adopt_next_ = false;
      if (start_now) waiting_to_start_ = false;
    }
  }
  try {
    if (start_now) {
      start();
      const std::lock_guard<std::mutex> lock(mutex_);
      identify_next_ = true;
    }
    if (adopt_now) ROS_INFO_STREAM(adopt());
  } catch (const Error& error) {
    fail(error.what());
  }
}

void IdentificationNode::diagnose_reading(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  using Level = diagnostic_msgs::DiagnosticStatus;
  if (!misread_.empty())
    status.summary(Level::ERROR, misread_);
  else
    status.summary(Level::OK, result_.is_object() ? "read as it stands, or as assumed" : "no log yet");
  status.add("state", name(state_));
}

void IdentificationNode::watch_recording() {
  const JointRecording::Pose pose = recording_->pose();
  const JointRecording::Summary summary = recording_->summary();
  std::ostringstream text;
  if (pose.age > timeout_) {
    text << "no message on " << topic_ << " for " << timeout_ << " s";
    if (summary.dropped > 0)
      text << " that could be used; the first of " << summary.dropped << ": " << summary.first_drop;
  } else if (state_ == State::recording && summary.duration >= duration_) {
    return end_recording("");
  } else if (state_ == State::moving) {
    const double t = (pose.stamp - commanded_).toSec(), end = motion_.t[motion_.samples() - 1];
    int joint = 0;
    const double error = tracking_error(motion_, t, pose.q, joint);
    if (error > tolerance_) {
      text << "the robot does not follow: joint '" << robot_.joints[static_cast<std::size_t>(joint - 1)].name
           << "' is " << error << " rad from where it should be after " << t
           << " s (was the command refused?)";
    } else if (t > end + 1.0) {
      return end_recording("");
    } else {
      std_msgs::Float32 done;
      done.data = static_cast<float>(std::clamp(t / (end + 1.0), 0.0, 1.0));
      fraction_.publish(done);
    }
  }
  const std::string trouble = text.str();
  if (!trouble.empty()) {
    if (state_ == State::moving) command_.publish(trajectory_msgs::JointTrajectory());
    return end_recording(trouble);
  }
  text << name(state_) << ": " << summary.messages << " messages, ";
  if (!command_topic_.empty()) text << commanding_.summary().messages << " commands, ";
  text << std::lround(summary.duration) << " s";
  // Once a second of it, and where messages pause.
  const bool paused = pose.age > 0.2 && summary.messages != told_messages_;
  if (std::abs(summary.duration - told_duration_) < 1.0 && summary.messages > 0 && !paused) return;
  told_duration_ = summary.duration;
  told_messages_ = summary.messages;
  say(text.str());
}

void IdentificationNode::end_recording(const std::string& trouble) {
  recording_->stop();
  commanding_.stop();
  if (recording_->summary().messages == 0) {
    identify_next_ = false;
    state_ = State::idle;
    fail(trouble.empty() ? "nothing was recorded" : trouble);
    return;
  }
  work(State::saving, [this, trouble] { save(trouble); });
}

void IdentificationNode::prepare() {
  const auto wait_for_pose = [this] {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(timeout_);
    for (;;) {
      JointRecording::Pose pose = recording_->pose();
      if (pose.known && pose.age < timeout_) return pose;
      if (ros::SteadyTime::now() > end)
        throw Error("no message on " + topic_ + " that shows where the robot is");
      ros::WallDuration(0.02).sleep();
    }
  };
  wait_for_pose();
  const std::string file = parameters_.text("trajectory", "");
  const Trajectory motion =
      file.empty() ? find_motion(settings(), context()) : read_trajectory(file, robot_.size());
  const double share = parameters_.number("approach_velocity", 0.1, {0.0, 1.0, true});
  for (int i = 0; command_.getNumSubscribers() == 0; ++i) {
    if (cancel_) throw Stopped();
    if (i == 100) throw Error("nobody listens to " + private_.resolveName("command"));
    ros::WallDuration(0.05).sleep();
  }
  const JointRecording::Pose pose = wait_for_pose();
  if (pose.dq.size() > 0 && pose.dq.cwiseAbs().maxCoeff() > 0.05) throw Error("the robot is not at rest");
  const Trajectory all = with_approach(robot_, pose.q, motion, share);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (cancel_) throw Stopped();
  motion_ = all;
  bag_.clear();
  recording_->start();
  commanding_.start();
  commanded_ = pose.stamp;
  command_.publish(to_message(all, robot_));
  state_ = State::moving;
  say("moving: " + std::to_string(std::lround(all.t[all.samples() - 1])) + " s");
}

void IdentificationNode::save(const std::string& ended) {
  const JointRecording::Summary summary = recording_->summary();
  const IdentificationSettings now = settings();
  make_folder(now);
  const std::string file = file_in_folder(now, "recording.bag");
  const CommandRecording::Summary commands = commanding_.summary();
  std::string trouble = ended;
  if (command_topic_.empty()) {
    write_bag(file, recording_->messages(), topic_, BagCompression::lz4);
  } else {
    write_servo_bag(file, recording_->messages(), recording_->arrivals(), topic_, commanding_.messages(),
                    command_topic_, BagCompression::lz4);
    if (commands.messages == 0 && trouble.empty()) trouble = "no command on " + command_topic_;
  }
  std::ostringstream text;
  text << summary.messages << " messages, ";
  if (!command_topic_.empty()) text << commands.messages << " commands, ";
  text << summary.duration << " s, in " << file;
  if (summary.dropped > 0) text << "; " << summary.dropped << " dropped, the first: " << summary.first_drop;
  if (commands.dropped > 0)
    text << "; " << commands.dropped << " commands dropped, the first: " << commands.first_drop;
  if (summary.dropped + commands.dropped > 0) ROS_WARN_STREAM(text.str());
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    bag_ = file;
    if (!trouble.empty() || !identify_next_ || cancel_) {
      identify_next_ = false;
      state_ = State::idle;
      if (trouble.empty()) {
        say("recorded: " + text.str());
      } else {
        fail(trouble + "; recorded until then: " + text.str());
      }
      return;
    }
    identify_next_ = false;
    state_ = State::identifying;
    say("recorded: " + text.str());
  }
  run();
}

void IdentificationNode::run() {
  nlohmann::json result = identify_log(settings(), bag_, context(), nullptr);
  const JointRecording::Summary summary = recording_->summary();
  result["recording"] = {{"messages", summary.messages},
                         {"dropped", summary.dropped},
                         {"first_drop", summary.first_drop},
                         {"duration", summary.duration}};
  if (!command_topic_.empty()) {
    const CommandRecording::Summary commands = commanding_.summary();
    result["recording"]["commands"] = commands.messages;
    result["recording"]["commands_dropped"] = commands.dropped;
    result["recording"]["first_command_drop"] = commands.first_drop;
  }
  result["adopted"] = nullptr;
  const std::lock_guard<std::mutex> lock(mutex_);
  result_ = result;
  misread_ = result["misread"];
  if (!misread_.empty()) ROS_ERROR_STREAM(bag_ << ": " << misread_);
  adopt_next_ = parameters_.flag("auto_adopt", false) && misread_.empty();
  state_ = State::idle;
  std_msgs::Float32 whole;
  whole.data = 1.0F;
  fraction_.publish(whole);
  say("done: " + result_["files"]["model"].get<std::string>());
  std_msgs::String message;
  message.data = result_.dump();
  result_publisher_.publish(message);
}

}  // namespace
}  // namespace dynid

int main(int argc, char** argv) {
  // A bag named on the command line is worked on without a roscore, which ros::init() would wait for.
  const dynid::Texts options = dynid::command_line(argc, argv);
  if (options.count("bag") > 0) {
    std::signal(SIGINT, dynid::on_signal);
    return dynid::identify_bag(options);
  }
  ros::init(argc, argv, "identification", ros::init_options::NoSigintHandler);
  try {
    const ros::NodeHandle node("~");
    std::signal(SIGINT, dynid::on_signal);
    std::signal(SIGTERM, dynid::on_signal);
    if (!node.param<std::string>("bag", "").empty()) return dynid::identify_bag(dynid::on_server(node));
    dynid::IdentificationNode().spin();
  } catch (const std::exception& error) {
    std::cerr << "identification_node: " << dynid::one_line(error.what()) << std::endl;  // ROS is shut down
    return 2;
  }
  return 0;
}
