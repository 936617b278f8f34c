// SPDX-License-Identifier: Apache-2.0
//
// Conducts launch/demo.launch: by the topics and services that a person would use it has an arm with a hidden
// effect identified and diagnosed, the result adopted by the torque estimator, and the arm pushed. It tells
// what happens, writes summary.json, and ends. See docs/nodes.md.
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/serialise.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/number.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/model/robot_file.hpp"
#include "ros/joint_state.hpp"
#include "ros/parameters.hpp"

namespace dynid {
namespace {

using Eigen::VectorXd;

void say(const std::string& line) { std::cout << line << std::endl; }

std::string in_a_row(const VectorXd& x) {
  std::string text;
  for (const double value : x) {
    char number[32];
    std::snprintf(number, sizeof number, "%8.2f", value);
    text += number;
  }
  return text;
}

std::string number(double x, int digits = 3) { return short_number(x, digits); }

std::vector<std::string> names(const Robot& robot) {
  std::vector<std::string> list;
  for (const Joint& joint : robot.joints) list.push_back(joint.name);
  return list;
}

class Demo {
 public:
  Demo();
  /// Throws Error where a step fails.
  void run();
  void write_summary();
  nlohmann::json summary = {{"ok", false}};

 private:
  /// What the torque estimator says over some time.
  struct Felt {
    VectorXd residual;                     ///< [N m] mean, n
    std::optional<Eigen::Vector3d> force;  ///< [N] mean of the wrench's, in the tip's axes
    bool contact = false;                  ///< flagged at any instant
    double after = -1.0;                   ///< [s] from the start to the first flag
  };

  /// Lets ROS work until the condition holds; throws Error when it does not within `seconds`.
  template <class F>
  void wait_for(const std::string& what, double seconds, const F& condition) const;
  /// The same for a time; `meanwhile` is called every 20 ms.
  Felt listen(double seconds, const std::function<void()>& meanwhile = {});
  std::string called(const std::string& service) const;            ///< empty: done
  void call(const std::string& service) const;                     ///< throws Error: not done
  VectorXd efforts(const sensor_msgs::JointState& message) const;  ///< of the robot's joints
  void identify();
  void tell(const nlohmann::json& result);
  void push();

  ros::NodeHandle node_, private_{"~"};
  Parameters parameters_{private_};
  Robot robot_;
  std::string out_;
  double patience_, rest_, push_duration_;
  Eigen::Vector3d force_;
  ros::Publisher push_;
  std::vector<ros::Subscriber> subscribers_;
  ros::WallTime start_ = ros::WallTime::now();

  // What the topics said.
  JointStateReader position_;
  bool placed_ = false, executing_ = false, contact_ = false;
  long residuals_ = 0, wrenches_ = 0;
  VectorXd sum_;
  Eigen::Vector3d force_sum_ = Eigen::Vector3d::Zero();
  ros::WallTime touched_;
  std::string progress_, pushed_link_;
  nlohmann::json result_;
};

Demo::Demo()
    : robot_(read_model_file(parameters_.required_text("model"), "", "", Consistency::ignore).robot),
      out_(parameters_.required_text("out")),
      patience_(parameters_.number("patience", 180.0, {1.0, 3600.0})),
      rest_(parameters_.number("rest", 2.0, {0.2, 60.0})),
      push_duration_(parameters_.number("push_duration", 1.5, {0.2, 60.0})),
      position_(names(robot_)),
      sum_(VectorXd::Zero(robot_.size())) {
  const VectorXd force = parameters_.numbers("push_force", 3, {-200.0, 200.0});
  force_ = force.size() == 3 ? Eigen::Vector3d(force) : Eigen::Vector3d(12.0, 16.0, -10.0);
  push_ = node_.advertise<geometry_msgs::WrenchStamped>("plant/push", 1);
  subscribers_ = {
      node_.subscribe<sensor_msgs::JointState>(
          "joint_states", 1,
          [this](const sensor_msgs::JointState::ConstPtr& m) { placed_ = position_.read(*m) || placed_; }),
      node_.subscribe<sensor_msgs::JointState>("torque_estimator/residual", 0,
                                               [this](const sensor_msgs::JointState::ConstPtr& m) {
                                                 sum_ += efforts(*m);
                                                 ++residuals_;
                                               }),
      node_.subscribe<geometry_msgs::WrenchStamped>(
          "torque_estimator/external_wrench", 0,
          [this](const geometry_msgs::WrenchStamped::ConstPtr& m) {
            if (m->header.frame_id != robot_.tip_link) return;
            force_sum_ += Eigen::Vector3d(m->wrench.force.x, m->wrench.force.y, m->wrench.force.z);
            ++wrenches_;
          }),
      node_.subscribe<std_msgs::Bool>("torque_estimator/contact", 0,
                                      [this](const std_msgs::Bool::ConstPtr& m) {
                                        if (m->data && touched_.isZero()) touched_ = ros::WallTime::now();
                                        contact_ = m->data;
                                      }),
      node_.subscribe<std_msgs::String>("torque_estimator/contact_link", 0,
                                        [this](const std_msgs::String::ConstPtr& m) {
                                          if (!m->data.empty()) pushed_link_ = m->data;
                                        }),
      node_.subscribe<std_msgs::Bool>("plant/executing", 10,
                                      [this](const std_msgs::Bool::ConstPtr& m) { executing_ = m->data; }),
      node_.subscribe<std_msgs::String>("identification/progress", 10,
                                        [this](const std_msgs::String::ConstPtr& m) { progress_ = m->data; }),
      node_.subscribe<std_msgs::String>("identification/result", 1,
                                        [this](const std_msgs::String::ConstPtr& m) {
                                          result_ = nlohmann::json::parse(m->data, nullptr, false);
                                        })};
}

VectorXd Demo::efforts(const sensor_msgs::JointState& message) const {
  VectorXd values(robot_.size());
  for (Eigen::Index j = 0; j < values.size(); ++j) {
    const std::string& name = robot_.joints[static_cast<std::size_t>(j)].name;
    const auto at = static_cast<std::size_t>(std::find(message.name.begin(), message.name.end(), name) -
                                             message.name.begin());
    if (at >= message.effort.size()) throw Error("the residual has no joint '" + name + "'");
    values[j] = message.effort[at];
  }
  return values;
}

template <class F>
void Demo::wait_for(const std::string& what, double seconds, const F& condition) const {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(seconds);
  for (;;) {
    ros::spinOnce();
    if (condition()) return;
    if (!ros::ok()) throw Error("interrupted while waiting for " + what);
    if (result_.is_object() && result_.contains("error"))
      throw Error("identification: " + result_.at("error").dump());
    if (ros::WallTime::now() > end)
      throw Error(what + ": not within " + number(seconds) + " s" +
                  (progress_.empty() ? "" : " (identification: " + progress_ + ")"));
    ros::WallDuration(0.001).sleep();
  }
}

Demo::Felt Demo::listen(double seconds, const std::function<void()>& meanwhile) {
  ros::spinOnce();
  sum_.setZero();
  force_sum_.setZero();
  residuals_ = wrenches_ = 0;
  const ros::WallTime start = ros::WallTime::now();
  touched_ = contact_ ? start : ros::WallTime();
  ros::WallTime next = start;
  wait_for("time to pass", seconds + 10.0, [&] {
    const ros::WallTime now = ros::WallTime::now();
    if (meanwhile && now >= next) {
      meanwhile();
      next = now + ros::WallDuration(0.02);
    }
    return (now - start).toSec() >= seconds;
  });
  if (residuals_ == 0) throw Error("the torque estimator says nothing");
  Felt felt;
  felt.residual = sum_ / double(residuals_);
  if (wrenches_ > 0) felt.force = force_sum_ / double(wrenches_);
  felt.contact = !touched_.isZero();
  if (felt.contact) felt.after = (touched_ - start).toSec();
  return felt;
}

std::string Demo::called(const std::string& service) const {
  std_srvs::Trigger trigger;
  const std::string name = node_.resolveName(service);
  if (!ros::service::call(name, trigger)) return name + ": no answer";
  return trigger.response.success ? "" : name + ": " + trigger.response.message;
}

void Demo::call(const std::string& service) const {
  const std::string complaint = called(service);
  if (!complaint.empty()) throw Error(complaint);
}

void Demo::identify() {
  call("identification/start");
  wait_for("the exciting motion's start", patience_, [this] { return executing_; });
  say("   the arm moves");
  wait_for("the exciting motion's end", patience_, [this] { return !executing_; });
  say("   it rests again; identifying");
  result_ = nullptr;
  ros::WallTime next;
  wait_for("the end of the recording", 30.0, [&] {  // the node says when it is ready
    if (ros::WallTime::now() < next) return false;
    next = ros::WallTime::now() + ros::WallDuration(0.5);
    return called("identification/identify").empty();
  });
  wait_for("the identification's result", patience_, [this] { return !result_.is_null(); });
  try {
    tell(result_);
  } catch (const nlohmann::json::exception& error) {
    throw Error(std::string("the identification's result: ") + error.what());
  }
}

void Demo::tell(const nlohmann::json& result) {
  const nlohmann::json &identification = result.at("identification"), &retrieval = result.at("retrieval"),
                       &diagnosis = result.at("diagnosis");
  say("   identified: " + number(identification.at("rank")) + " coefficients, relative error " +
      number(identification.at("relative_error_percent")) + " %");
  summary["identified"] = {{"rank", identification.at("rank")},
                           {"relative_error_percent", identification.at("relative_error_percent")}};
  if (!retrieval.is_null()) {
    say(retrieval.at("feasible")
            ? "   retrieved: feasible parameters, total mass " + number(retrieval.at("total_mass")) + " kg"
            : std::string("   retrieved: nothing feasible"));
    summary["identified"]["feasible"] = retrieval.at("feasible");
    summary["identified"]["total_mass"] = retrieval.at("total_mass");
  }
  say("   diagnosis of what the arm was thought to be: " + diagnosis.at("verdict").get<std::string>());
  for (const nlohmann::json& effect : diagnosis.at("effects")) {
    std::string line =
        "     " + effect.at("name").get<std::string>() + ", probability " + number(effect.at("probability"));
    for (const nlohmann::json& alias : effect.at("aliases"))
      line +=
          (&alias == &effect.at("aliases").front() ? "; not told from " : ", ") + alias.get<std::string>();
    say(line);
    for (const auto& [key, p] : effect.at("parameters").items()) {
      std::string values;
      for (const nlohmann::json& value :
           p.at("value").is_array() ? p.at("value") : nlohmann::json{p.at("value")})
        values += " " + number(value);
      if (p.at("value").is_number())
        values += " (" + number(p.at("low")) + " to " + number(p.at("high")) + ")";
      say("       " + key + " [" + p.at("unit").get<std::string>() + "]" + values);
    }
  }
  say("     the gap shrinks by " + number(100.0 * diagnosis.at("shrink").at("fraction").get<double>(), 5) +
      " % on data not used");
  summary["diagnosis"] = {{"verdict", diagnosis.at("verdict")},
                          {"effects", diagnosis.at("effects")},
                          {"shrink", diagnosis.at("shrink").at("fraction")}};
  summary["files"] = result.at("files");
}

void Demo::push() {
  geometry_msgs::WrenchStamped message;
  message.header.frame_id = robot_.base_link;
  const auto send = [&](const Eigen::Vector3d& force) {
    message.header.stamp = ros::Time::now();
    message.wrench.force.x = force.x(), message.wrench.force.y = force.y(),
    message.wrench.force.z = force.z();
    push_.publish(message);
  };
  pushed_link_.clear();
  const Felt onset = listen(0.5 * push_duration_, [&] { send(force_); });
  const Felt felt = listen(0.5 * push_duration_, [&] { send(force_); });
  send(Eigen::Vector3d::Zero());
  const Model<> model(robot_);
  Workspace<> ws(model);
  Eigen::MatrixXd J(6, model.size());
  jacobian(model, ws, position_.q(), robot_.tip, J);
  const VectorXd torque = J.topRows<3>().transpose() * force_;
  const double error = (felt.residual - torque).norm() / torque.norm();
  say("   joint torques it makes [N m]  " + in_a_row(torque));
  say("   residual [N m]                " + in_a_row(felt.residual) + "  (" + number(100.0 * error) +
      " % off)");
  nlohmann::json force;
  if (felt.force) {
    std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(model.size()) + 1);
    forward_kinematics(model, ws, position_.q(), poses);
    const Eigen::Vector3d in_base = poses.back().linear() * *felt.force;
    force = to_json(in_base);
    say("   force at the tip [N]          " + in_a_row(force_) + "; felt" + in_a_row(in_base));
  } else {
    say("   the force at the tip is not told: the arm is near a singularity");
  }
  say(onset.contact ? "   contact flagged after " + number(1e3 * onset.after) + " ms" +
                          (pushed_link_.empty() ? "" : ", on " + pushed_link_)
                    : "   no contact flagged");
  summary["push"] = {{"force", to_json(force_)},
                     {"torque", to_json(torque)},
                     {"residual", to_json(felt.residual)},
                     {"force_felt", force},
                     {"relative_error", error},
                     {"contact", onset.contact && felt.contact},
                     {"link", pushed_link_},
                     {"detected_after_s", onset.after}};
  wait_for("the end of the contact", 5.0, [this] { return !contact_; });
}

void Demo::run() {
  wait_for("the arm's joint states", 30.0, [this] { return placed_; });
  wait_for("the torque estimator", 30.0, [this] { return residuals_ > 0; });
  for (const char* service : {"start", "identify", "adopt"}) {
    const std::string name = std::string("identification/") + service;
    if (!ros::service::waitForService(name, 30000)) throw Error(node_.resolveName(name) + ": not there");
  }
  say("1. An arm at rest. Its controller and its torque estimator know " + robot_.name +
      ", not what else there is.");
  listen(1.5 * rest_);  // until it has settled
  const Felt before = listen(rest_);
  say("   residual at rest [N m]        " + in_a_row(before.residual));
  say(before.contact ? "   taken for a contact: there is a torque that the model does not have"
                     : "   no contact flagged");
  summary["rest_before"] = {{"residual", to_json(before.residual)}, {"contact", before.contact}};

  say("2. A motion that excites the parameters is looked for, played and recorded; then the model is "
      "identified.");
  identify();

  say("3. The torque estimator adopts the identified model while it runs.");
  call("identification/adopt");
  listen(0.75 * rest_);
  const Felt after = listen(rest_);
  say("   residual at rest [N m]        " + in_a_row(after.residual) + (after.contact ? "  contact" : ""));
  summary["rest_after"] = {{"residual", to_json(after.residual)}, {"contact", after.contact}};

  say("4. Somebody pushes the arm at its tip with " + number(force_.norm()) + " N.");
  push();
  summary["ok"] = true;
}

void Demo::write_summary() {
  summary["seconds"] = (ros::WallTime::now() - start_).toSec();
  std::filesystem::create_directories(out_);
  const std::string path = out_ + "/summary.json";
  write_file(path, summary.dump(2) + "\n");
  say("Summary: " + path);
}

}  // namespace
}  // namespace dynid

int main(int argc, char** argv) {
  ros::init(argc, argv, "demo");
  const ros::NodeHandle handle;  // the last one to go takes ROS' logging with it
  try {
    dynid::Demo demo;
    int status = 0;
    try {
      demo.run();
    } catch (const dynid::Error& error) {
      ROS_FATAL_STREAM(error.what());
      demo.summary["error"] = error.what();
      status = 1;
    }
    demo.write_summary();
    return status;
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(error.what());
    return 2;
  }
}
