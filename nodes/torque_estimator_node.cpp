// SPDX-License-Identifier: Apache-2.0
//
// Joint states in, model torque, friction, external torque, residual, wrench and contact out: docs/nodes.md.
//
// Two threads. The loop (main) does nothing but take messages and answer them; tf, services, diagnostics and
// reconfiguration are in the other, and reach the loop without ever making it wait.
#include <diagnostic_updater/diagnostic_updater.h>
#include <dynamic_reconfigure/server.h>
#include <dynid/TorqueEstimatorConfig.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <cstdio>
#include <memory>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/model/yaml.hpp"
#include "ros/estimator_core.hpp"
#include "ros/estimator_diagnostics.hpp"
#include "ros/estimator_frames.hpp"
#include "ros/estimator_outputs.hpp"
#include "ros/estimator_setup.hpp"
#include "ros/parameters.hpp"

namespace dynid {

namespace {

class TorqueEstimatorNode {
 public:
  TorqueEstimatorNode()
      : parameters_(private_),
        setup_(read_estimator_setup(parameters_)),
        tuned_(setup_.core.estimator),
        frames_(setup_.model.file.robot, setup_.frames),
        core_(model(), setup_.joints, setup_.core),
        outputs_(private_, setup_.joints, link_names(setup_),
                 setup_.frames.prefix + setup_.model.file.robot.base_link, frames_.wrench_frame_name(),
                 setup_.queue),
        diagnostics_(setup_.joints, handle_.resolveName(setup_.topic), setup_.silence),
        watch_(static_cast<int>(setup_.joints.size()), setup_.assumed ? 0.0 : setup_.reading_window) {
    core_.set_wrench_frame(frames_.wrench_frame());
    for (const std::string& name : parameters_.unknown())
      ROS_WARN("%s is set, and nobody asks for it", name.c_str());
    tell_of_test();
    model_publisher_ = private_.advertise<std_msgs::String>("parameters", 1, true);
    publish_model();

    serve("set_payload", &TorqueEstimatorNode::set_payload);
    serve("reset", &TorqueEstimatorNode::reset);
    serve("load_parameters", &TorqueEstimatorNode::load_parameters);
    reconfigure_.setCallback([this](TorqueEstimatorConfig& config, std::uint32_t) { reconfigured(config); });

    updater_.setHardwareID(setup_.model.file.robot.name);
    updater_.add("input", [this](auto& status) { diagnostics_.input(status); });
    updater_.add("output", [this](auto& status) { diagnostics_.output(status, tuned_.contact_threshold); });
    updater_.add("model", [this](auto& status) {
      EstimatorDiagnostics::model(status, setup_.model, setup_.payload, trouble_);
    });
    updater_.add("frames", [this](auto& status) { EstimatorDiagnostics::frames(status, frames_); });
    updater_.add("reading", [this](auto& status) {
      EstimatorDiagnostics::reading(status, watch_, setup_.assumed, setup_.reading_window);
    });
    if (!setup_.assumed && setup_.reading_window > 0.0)
      watch_timer_ = handle_.createWallTimer(ros::WallDuration(setup_.reading_window / 3000.0),
                                             [this](const ros::WallTimerEvent&) { watch(); });
    report_timer_ = handle_.createWallTimer(ros::WallDuration(setup_.diagnostic_period),
                                            [this](const ros::WallTimerEvent&) { report(); });
    if (frames_.needs_tf()) {
      tf_listener_ = std::make_unique<tf2_ros::TransformListener>(tf_);
      tf_timer_ = handle_.createWallTimer(ros::WallDuration(setup_.tf_period),
                                          [this](const ros::WallTimerEvent&) { look_up(); });
    }

    ros::SubscribeOptions options = ros::SubscribeOptions::create<sensor_msgs::JointState>(
        setup_.topic, static_cast<std::uint32_t>(setup_.queue),
        [this](const sensor_msgs::JointState::ConstPtr& message) { answer(*message); }, ros::VoidPtr(),
        &loop_queue_);
    options.transport_hints = ros::TransportHints().tcpNoDelay();
    subscriber_ = handle_.subscribe(options);
  }

  void run() {
    ros::AsyncSpinner others(1);
    others.start();
    while (ros::ok()) loop_queue_.callAvailable(ros::WallDuration(0.1));
    others.stop();
  }

 private:
  // ----------------------------------------------------------------------------------------------- the loop
  void answer(const sensor_msgs::JointState& message) {
    const EstimatorAnswer& given = core_.handle(message, ros::Time::now().toSec());
    if (given.withheld == Withheld::none) outputs_.publish(given, message.header.stamp);
  }

  // ---------------------------------------------------------------------------------------- the other thread
  /// The model with the payload and gravity in use.
  TorqueModel<> model() const { return model(setup_.model.file.robot, setup_.payload); }
  TorqueModel<> model(const Robot& robot, const LinkInertia& payload) const {
    TorqueModel<> made(robot, Uncompensated::ignore);  // refused, if that was asked for, as it was read
    if (payload.mass > 0.0) made.set_payload(payload);
    made.set_gravity(frames_.gravity());
    return made;
  }

  void look_up() {
    if (frames_.update(tf_)) {
      core_.adopt(model());
      ROS_INFO("gravity %s: %.3f %.3f %.3f m/s^2", frames_.gravity_text().c_str(), frames_.gravity().x(),
               frames_.gravity().y(), frames_.gravity().z());
    }
    core_.set_wrench_frame(frames_.wrench_frame());
  }

  void watch() {
    const JointSample* const sample = core_.sample();
    if (sample == nullptr) return;
    watch_.add(*sample);
    if (!watch_.due()) return;
    Robot nominal = setup_.model.file.robot;
    nominal.gravity = frames_.gravity();
    if (setup_.payload.mass > 0.0) nominal = with_payload(nominal, setup_.payload);
    if (watch_.ask(nominal) && !watch_.text().empty()) ROS_ERROR_THROTTLE(60.0, "%s", watch_.text().c_str());
  }

  void report() {
    diagnostics_.begin(core_.record(), ros::WallTime::now().toSec(),
                       static_cast<int>(subscriber_.getNumPublishers()));
    updater_.force_update();
  }

  void publish_model() {
    std_msgs::String message;
    message.data = to_yaml(setup_.model.file, setup_.model.uncertainty);
    model_publisher_.publish(message);
  }

  void reconfigured(const TorqueEstimatorConfig& config) {
    tuned_ = setup_.core.estimator;
    tuned_.gain *= config.gain_factor;
    tuned_.contact_threshold *= config.threshold_factor;
    tuned_.contact_release = config.contact_release;
    tuned_.acceleration_cutoff = config.acceleration_cutoff;
    core_.retune(tuned_);  // the ranges of config/TorqueEstimator.cfg leave nothing to refuse
  }

  using Response = std_srvs::Trigger::Response;
  /// A service whose refusal is an Error, which changes nothing.
  void serve(const char* name, std::string (TorqueEstimatorNode::*action)()) {
    services_.push_back(private_.advertiseService<std_srvs::Trigger::Request, Response>(
        name, [this, name, action](std_srvs::Trigger::Request&, Response& response) {
          try {
            response.message = (this->*action)();
            response.success = true;
            trouble_.clear();
            ROS_INFO("%s: %s", name, response.message.c_str());
          } catch (const Error& error) {
            response.message = trouble_ = error.what();
            response.success = false;
            ROS_WARN("%s: %s", name, error.what());
          }
          return true;
        }));
  }

  std::string reset() {
    core_.reset();
    return "starts anew with the next message";
  }

  std::string set_payload() {
    const LinkInertia payload = read_estimator_payload(parameters_);
    core_.adopt(model(setup_.model.file.robot, payload));
    setup_.payload = payload;
    return "payload of " + short_number(payload.mass) + " kg";
  }

  std::string load_parameters() {
    EstimatorModel loaded = read_estimator_model(parameters_);
    const Robot& robot = loaded.file.robot;
    if (robot.size() != static_cast<int>(setup_.joints.size()))
      parameters_.refuse("model", loaded.path + " has " + std::to_string(robot.size()) + " joints, not " +
                                      std::to_string(setup_.joints.size()));
    const Robot& before = setup_.model.file.robot;
    for (int i = 0; i < robot.size(); ++i)
      if (robot.joints[i].name != before.joints[i].name)
        parameters_.refuse("model", loaded.path + " calls joint " + std::to_string(i + 1) + " '" +
                                        robot.joints[i].name + "', not '" + before.joints[i].name + "'");
    if (tuned_.order == ObserverOrder::kalman && !loaded.uncertainty)
      parameters_.refuse("model", loaded.path + " has no `uncertainty:`, which a Kalman observer needs");
    frames_.set_robot(robot);
    core_.adopt(model(robot, setup_.payload));
    if (const double alarms = false_alarms_allowed(); alarms > 0.0) {
      setup_.core.estimator.uncertainty = tuned_.uncertainty = loaded.uncertainty;
      tuned_.test.false_alarms_per_hour = alarms;
      core_.retune(tuned_);
    }
    setup_.model = std::move(loaded);
    tell_of_test();
    publish_model();
    return setup_.model.path;
  }

  double false_alarms_allowed() const {
    return parameters_.number("false_alarms_per_hour", 0.0, {0.0, 3600.0});
  }
  /// Who asks for false alarms an hour may get fixed thresholds: that is said.
  void tell_of_test() const {
    if (false_alarms_allowed() > 0.0 && !setup_.model.uncertainty)
      ROS_WARN(
          "~false_alarms_per_hour: %s has no `uncertainty:`, which dynid identify --out writes; a contact is "
          "told by fixed thresholds until a model with it is loaded",
          setup_.model.path.c_str());
  }

  static std::vector<std::string> link_names(const EstimatorSetup& setup) {
    std::vector<std::string> names;
    for (const Joint& joint : setup.model.file.robot.joints) names.push_back(joint.link_name);
    return names;
  }

  ros::NodeHandle handle_, private_{"~"};
  Parameters parameters_;
  EstimatorSetup setup_;
  TorqueEstimatorOptions tuned_;
  EstimatorFrames frames_;
  EstimatorCore core_;
  EstimatorOutputs outputs_;
  EstimatorDiagnostics diagnostics_;
  ReadingWatch watch_;
  std::string trouble_;  // why the last change was refused

  diagnostic_updater::Updater updater_;
  dynamic_reconfigure::Server<TorqueEstimatorConfig> reconfigure_{private_};
  tf2_ros::Buffer tf_;
  std::unique_ptr<tf2_ros::TransformListener> tf_listener_;
  std::vector<ros::ServiceServer> services_;
  ros::Publisher model_publisher_;
  ros::WallTimer report_timer_, tf_timer_, watch_timer_;
  ros::CallbackQueue loop_queue_;
  ros::Subscriber subscriber_;
};

}  // namespace

}  // namespace dynid

int main(int argc, char** argv) try {
  ros::init(argc, argv, "torque_estimator");
  dynid::TorqueEstimatorNode().run();
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "torque_estimator_node: %s\n", error.what());
  return 2;
}
