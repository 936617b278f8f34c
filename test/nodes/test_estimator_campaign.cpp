// SPDX-License-Identifier: Apache-2.0
//
// torque_estimator_node with everything that can go wrong on its topics: said in /diagnostics, and nothing
// wrong published. The nodes: torque_estimator (gravity of the model), estimator_tf (gravity and the wrench's
// frame through a tf that comes late), estimator_alone (a tf that never comes).
#include <dynamic_reconfigure/DoubleParameter.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <limits>
#include <memory>

#include "dynid/dynamics/kinematics.hpp"
#include "dynid/model/yaml.hpp"
#include "nodes/arm.hpp"
#include "nodes/estimator_client.hpp"

namespace dynid {
namespace {

using sensor_msgs::JointState;
using test::EstimatorClient;
using Diagnostic = EstimatorClient::Diagnostic;

const char panda[] = DYNID_SOURCE_DIR "/config/panda.yaml";
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
enum Level { ok = 0, warn = 1, error = 2 };

std::string directory_of_programs() {
  std::array<char, 4096> path;
  const ssize_t size = readlink("/proc/self/exe", path.data(), path.size());
  const std::string program(path.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  return program.substr(0, program.rfind('/'));
}

class EstimatorNode : public testing::Test {
 protected:
  using Change = std::function<void(JointState&, int)>;

  void SetUp() override {
    if (!publisher_) publish();
    ASSERT_TRUE(EstimatorClient::wait([] { return publisher_->getNumSubscribers() >= 3; }, 20.0));
    arm_->external.setZero();
    arm_->amplitude = 0.3;
    ASSERT_TRUE(answers()) << node_->diagnostic("input").message;
  }

  /// Whatever was before: all three nodes come to answer.
  static bool answers() {
    for (int tries = 0; tries < 20; ++tries) {
      const std::vector<ros::Time> stamps = send(300);
      const std::vector<ros::Time> last(stamps.end() - 10, stamps.end());
      quiet(*node_);
      if (node_->answers(last) == 10 && tf_node_->answers(last) == 10 && alone_->answers(last) == 10)
        return true;
    }
    return false;
  }

  static void SetUpTestSuite() {
    handle_ = std::make_unique<ros::NodeHandle>();
    arm_ = std::make_unique<test::Arm>(read_robot(panda));
    node_ = std::make_unique<EstimatorClient>(*handle_, "torque_estimator");
    tf_node_ = std::make_unique<EstimatorClient>(*handle_, "estimator_tf");
    alone_ = std::make_unique<EstimatorClient>(*handle_, "estimator_alone");
    spinner_ = std::make_unique<ros::AsyncSpinner>(1);
    spinner_->start();
  }
  static void TearDownTestSuite() {
    spinner_.reset();  // it has a node handle, which must not outlive roscpp's own statics
    publisher_.reset(), alone_.reset(), tf_node_.reset(), node_.reset(), handle_.reset();
  }

  static void publish() {
    publisher_ = std::make_unique<ros::Publisher>(handle_->advertise<JointState>("joint_states", 1000));
  }
  /// `count` messages at 1 kHz, each changed before it goes. Returns their stamps: those of a robot's clock,
  /// however late this process wakes up.
  static std::vector<ros::Time> send(int count, const Change& change = nullptr) {
    std::vector<ros::Time> stamps;
    auto next = std::chrono::steady_clock::now();
    ros::Time stamp = ros::Time::now();
    for (int k = 0; k < count; ++k) {
      next += std::chrono::milliseconds(1);
      stamp += ros::Duration(0.001);
      std::this_thread::sleep_until(next);
      JointState message = arm_->at(stamp.toSec() - start_);
      message.header.stamp = stamp;
      if (change) change(message, k);
      stamps.push_back(message.header.stamp);
      publisher_->publish(message);
    }
    return stamps;
  }
  /// The same after as many good ones as it takes to settle. Returns how many of the changed ones are
  /// answered.
  static int stream(int count, const Change& change = nullptr, EstimatorClient* node = nullptr) {
    constexpr int first = 200;
    std::vector<ros::Time> stamps = send(first + count, [&](JointState& message, int k) {
      if (k >= first && change) change(message, k - first);
    });
    stamps.erase(stamps.begin(), stamps.begin() + first);
    quiet(node != nullptr ? *node : *node_);
    return (node != nullptr ? *node : *node_).answers(stamps);
  }
  /// Until what was sent has been answered.
  static void quiet(EstimatorClient& node) {
    for (int last = -1; last != node.heard().residuals;) {
      last = node.heard().residuals;
      std::this_thread::sleep_for(test::time_scale() * std::chrono::milliseconds(200));
    }
  }
  /// Sends `count` changed messages: but for `allowed` none is answered, the count of `why` goes up by all
  /// the others, and the report says it.
  static void expect_withheld(const std::string& why, const std::string& joint, int count,
                              const Change& change, int allowed = 0) {
    SCOPED_TRACE(why);
    const long before = std::max(0L, node_->diagnostic("input").count(why));
    const int reports = node_->diagnostic("input").reports;
    const int answered = stream(count, change);
    const bool all = node_->reports(
        "input", [&](const Diagnostic& report) { return report.count(why) >= before + count - allowed; });
    const bool said = EstimatorClient::wait(
        [&] {
          return node_->said("input", reports, [&](const Diagnostic& report) {
            return report.level >= warn && report.message.find(why) != std::string::npos &&
                   (joint.empty() || report.message.find("(" + joint + ")") != std::string::npos);
          });
        },
        2.0);
    EXPECT_TRUE(all) << node_->diagnostic("input").count(why) << " after " << before << ", lost "
                     << node_->diagnostic("input").count("lost");
    EXPECT_TRUE(said) << node_->diagnostic("input").message;
    EXPECT_LE(answered, allowed) << "something was published";
    stream(10);
    expect_free();
  }
  static double largest(const std::vector<double>& values) {
    double most = values.empty() ? nan : 0.0;
    for (double x : values) most = std::isfinite(x) ? std::max(most, std::abs(x)) : nan;
    return most;
  }
  static void expect_free(const EstimatorClient& node = *node_, double tolerance = 0.1) {
    EXPECT_LT(largest(node.heard().residual.effort), tolerance);
    EXPECT_FALSE(node.heard().contact);
  }

  static std::unique_ptr<ros::NodeHandle> handle_;
  static std::unique_ptr<test::Arm> arm_;
  static std::unique_ptr<EstimatorClient> node_, tf_node_, alone_;
  static std::unique_ptr<ros::AsyncSpinner> spinner_;
  static std::unique_ptr<ros::Publisher> publisher_;
  static const double start_;
};

std::unique_ptr<ros::NodeHandle> EstimatorNode::handle_;
std::unique_ptr<test::Arm> EstimatorNode::arm_;
std::unique_ptr<EstimatorClient> EstimatorNode::node_, EstimatorNode::tf_node_, EstimatorNode::alone_;
std::unique_ptr<ros::AsyncSpinner> EstimatorNode::spinner_;
std::unique_ptr<ros::Publisher> EstimatorNode::publisher_;
const double EstimatorNode::start_ = ros::WallTime::now().toSec();

TEST_F(EstimatorNode, AnswersWithTheStampOfTheMessage) {
  stream(100);
  const EstimatorClient::Heard heard = node_->heard();
  EXPECT_EQ(heard.tau_model.name, arm_->at(0.0).name);
  EXPECT_EQ(heard.residual.header.stamp, heard.tau_model.header.stamp);
  EXPECT_EQ(heard.wrench.header.stamp, heard.residual.header.stamp);
  EXPECT_EQ(heard.wrench.header.frame_id, "panda_link8");
  EXPECT_EQ(heard.contact_joints.effort, std::vector<double>(7, 0.0));
  EXPECT_LT(largest(heard.tau_ext.effort), 0.3);
  expect_free();
  // tau_model is the torque that the arm had at that stamp.
  arm_->at(heard.tau_model.header.stamp.toSec() - start_);
  for (int i = 0; i < 7; ++i)
    EXPECT_NEAR(heard.tau_model.effort[i], arm_->tau()[i], 0.3) << "joint " << i + 1;
  EXPECT_TRUE(node_->reports("input", [](const Diagnostic& d) { return d.count("messages") >= 100; }));
  const Diagnostic model = node_->diagnostic("model");
  EXPECT_EQ(model.level, ok) << model.message;
  EXPECT_NE(model.values.at("file").find("config/panda.yaml"), std::string::npos);
  EXPECT_EQ(model.values.at("physically consistent"), "yes");
  EXPECT_NE(heard.parameters.find("dynid-model-1"), std::string::npos);
  EXPECT_EQ(node_->diagnostic("frames").level, ok);
  EXPECT_EQ(node_->diagnostic("reading").level, ok);
}

TEST_F(EstimatorNode, ReportsRateAndComputeTime) {
  std::thread listener([] {
    EXPECT_TRUE(node_->reports("input", [](const Diagnostic& d) {
      return d.level == ok && std::abs(d.number("mean dt [ms]") - 1.0) < 0.2 && d.number("rate [Hz]") > 500.0;
    }));
  });
  stream(1500);
  listener.join();
  const double worst = node_->diagnostic("output").number("worst compute time [us]");
  EXPECT_GT(worst, 0.0);
}

TEST_F(EstimatorNode, TakesJointsByName) {
  const int answered = stream(300, [](JointState& m, int k) {
    const JointState before = m;
    const std::size_t n = m.name.size();
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t from = (i * 3 + static_cast<std::size_t>(k / 100)) % n;
      m.name[i] = before.name[from], m.position[i] = before.position[from];
      m.velocity[i] = before.velocity[from], m.effort[i] = before.effort[from];
    }
    // A gripper in front and behind, with nothing to say; and arrays longer than the names.
    m.name.insert(m.name.begin(), "panda_finger_joint1"), m.name.push_back("panda_finger_joint2");
    for (auto* values : {&m.position, &m.velocity, &m.effort}) {
      values->insert(values->begin(), nan);
      values->insert(values->end(), 3, nan);
    }
  });
  EXPECT_EQ(answered, 300);
  EXPECT_EQ(node_->heard().residual.name, arm_->at(0.0).name);
  expect_free();
}

TEST_F(EstimatorNode, OtherJointsAreNotForIt) {
  const long before = node_->diagnostic("input").count("other joints");
  EXPECT_EQ(stream(400,
                   [](JointState& m, int k) {
                     if (k % 2 == 1) m.name.assign(m.name.size(), "finger");
                   }),
            200);
  EXPECT_TRUE(
      node_->reports("input", [&](const Diagnostic& d) { return d.count("other joints") >= before + 200; }));
  expect_free();
}

TEST_F(EstimatorNode, MissingJoint) {
  expect_withheld("joint missing", "panda_joint4", 300, [](JointState& m, int) {
    for (auto* values : {&m.position, &m.velocity, &m.effort}) values->erase(values->begin() + 3);
    m.name.erase(m.name.begin() + 3);
  });
}

TEST_F(EstimatorNode, JointNamedTwice) {
  expect_withheld("joint named twice", "panda_joint2", 200, [](JointState& m, int) {
    m.name.push_back("panda_joint2");
    for (auto* values : {&m.position, &m.velocity, &m.effort}) values->push_back(0.1);
  });
}

TEST_F(EstimatorNode, EmptyAndShortArrays) {
  const char why[] = "no position, velocity or effort";
  expect_withheld(why, "panda_joint1", 200, [](JointState& m, int) { m.velocity.clear(); });
  expect_withheld(why, "panda_joint1", 200, [](JointState& m, int) { m.effort.clear(); });
  expect_withheld(why, "panda_joint7", 200, [](JointState& m, int) { m.position.pop_back(); });
}

TEST_F(EstimatorNode, NotANumber) {
  const char why[] = "not a number, or far beyond a limit";
  expect_withheld(why, "panda_joint5", 200, [](JointState& m, int) { m.effort[4] = nan; });
  expect_withheld(why, "panda_joint1", 200, [](JointState& m, int) { m.position[0] = 1.0 / 0.0; });
  expect_withheld(why, "", 200, [](JointState& m, int) { m.velocity[2] = 1e9; });
  // One now and then: the others are answered as if nothing had been.
  EXPECT_EQ(stream(400,
                   [](JointState& m, int k) {
                     if (k % 10 == 5) m.velocity[6] = nan;
                   }),
            360);
  expect_free();
}

TEST_F(EstimatorNode, StaleInput) {
  JointState first;
  expect_withheld(
      "sample repeated", "", 300, [&](JointState& m, int k) { k == 0 ? void(first = m) : void(m = first); },
      1);
  // A driver that goes on with the same values and new stamps.
  expect_withheld(
      "sample repeated", "", 300,
      [&](JointState& m, int k) {
        if (k == 0) first = m;
        first.header.stamp = m.header.stamp;
        m = first;
      },
      1);
  // Ten seconds late: the first of them goes back in time, the others are merely old.
  expect_withheld(
      "stamp too far from now", "", 200, [](JointState& m, int) { m.header.stamp -= ros::Duration(10.0); },
      1);
  expect_withheld("no stamp", "", 200, [](JointState& m, int) { m.header.stamp = ros::Time(); });
}

TEST_F(EstimatorNode, TimeGoesBack) {
  const Diagnostic before = node_->diagnostic("input");
  expect_withheld("time went back", "", 50,
                  [](JointState& m, int k) { m.header.stamp -= ros::Duration(0.00401 * (k + 1)); });
  EXPECT_TRUE(node_->reports(
      "input", [&](const Diagnostic& d) { return d.count("starts") >= before.count("starts") + 50; }));
}

TEST_F(EstimatorNode, GapInTime) {
  stream(50);
  const Diagnostic before = node_->diagnostic("input");
  // Longer than the node takes for a gap, by the stamps alone.
  const ros::Time silent = ros::Time::now() + ros::Duration(0.3);
  ASSERT_TRUE(EstimatorClient::wait([&] { return ros::Time::now() >= silent; }));
  const std::vector<ros::Time> stamps = send(60);  // less than it takes to settle
  quiet(*node_);
  EXPECT_EQ(node_->answers(stamps), 0);
  EXPECT_TRUE(node_->reports("input", [&](const Diagnostic& d) {
    return d.count("gap in time") >= before.count("gap in time") + 1 &&
           d.count("settling after a start") >= before.count("settling after a start") + 59;
  }));
}

TEST_F(EstimatorNode, FeelsAPush) {
  arm_->external[1] = 8.0;
  stream(400);
  EXPECT_NEAR(node_->heard().residual.effort[1], 8.0, 0.4);
  EXPECT_NEAR(node_->heard().tau_ext.effort[1], 8.0, 0.4);
  EXPECT_TRUE(node_->heard().contact);
  EXPECT_EQ(node_->heard().contact_joints.effort[1], 1.0);
  EXPECT_EQ(node_->heard().contact_joints.effort[0], 0.0);
  arm_->external.setZero();
  stream(400);
  expect_free();
}

TEST_F(EstimatorNode, Reset) {
  arm_->external[0] = 8.0;
  stream(300);
  ASSERT_NEAR(node_->heard().residual.effort[0], 8.0, 0.4);
  const auto response = node_->call("reset");
  EXPECT_TRUE(response.success) << response.message;
  const std::vector<ros::Time> stamps = send(60);
  quiet(*node_);
  EXPECT_EQ(node_->answers(stamps), 0) << "it does not know yet";
}

TEST_F(EstimatorNode, PayloadWhileRunning) {
  const std::string space = "/torque_estimator/payload/";
  LinkInertia payload;
  payload.mass = 1.5;
  payload.com << 0.0, 0.02, 0.08;
  ros::param::set(space + "mass", payload.mass);
  ros::param::set(space + "com", std::vector<double>{0.0, 0.02, 0.08});
  arm_->model().set_payload(payload);
  stream(300);
  EXPECT_TRUE(node_->heard().contact) << "a payload that it does not know";
  const auto response = node_->call("set_payload");
  EXPECT_TRUE(response.success) << response.message;
  stream(300);
  expect_free();
  EXPECT_TRUE(
      node_->reports("model", [](const Diagnostic& d) { return d.number("payload mass [kg]") == 1.5; }));

  ros::param::set(space + "mass", -1.0);
  const auto refused = node_->call("set_payload");
  EXPECT_FALSE(refused.success);
  EXPECT_NE(refused.message.find(space + "mass: -1 is not in [0, 1000]"), std::string::npos)
      << refused.message;
  ros::param::set(space + "mass", 1.5);
  ros::param::set(space + "inertia", std::vector<double>{0.1, 0.0, 0.0, 0.1, 0.0, 0.3});
  const auto impossible = node_->call("set_payload");
  EXPECT_FALSE(impossible.success);
  EXPECT_NE(impossible.message.find(space + "inertia"), std::string::npos) << impossible.message;
  EXPECT_TRUE(node_->reports("model", [](const Diagnostic& d) {
    return d.level == warn && d.message.find("payload/inertia") != std::string::npos &&
           d.number("payload mass [kg]") == 1.5;
  }));
  stream(200);
  expect_free();

  ros::param::del(space + "inertia");
  ros::param::set(space + "mass", 0.0);
  arm_->model().set_payload(LinkInertia());
  EXPECT_TRUE(node_->call("set_payload").success);
}

TEST_F(EstimatorNode, ParametersReloadedWhileRunning) {
  const std::string key = "/torque_estimator/model",
                    file = testing::TempDir() + "/dynid_heavier_" + std::to_string(getpid()) + ".yaml";
  ModelFile heavier = read_model(panda);
  heavier.robot.joints[2].parameters *= 1.5;
  write_model(file, heavier);
  ros::param::set(key, file);

  const Diagnostic before = node_->diagnostic("input");
  std::atomic<bool> over{false};
  std::thread reload([&] {
    for (int k = 0; k < 10; ++k) {
      const int answered = node_->heard().residuals;  // spread over the messages
      EstimatorClient::wait([&] { return over || node_->heard().residuals >= answered + 80; });
      const auto response = node_->call("load_parameters");
      EXPECT_TRUE(response.success) << response.message;
    }
  });
  arm_ = std::make_unique<test::Arm>(heavier.robot);
  EXPECT_EQ(stream(1000), 1000) << "the loop did not wait";
  over = true;
  reload.join();
  EXPECT_LE(node_->diagnostic("input").count("starts"), before.count("starts") + 1);
  expect_free();
  EXPECT_NE(node_->heard().parameters.find("4.842"), std::string::npos) << "mass of link 3";
  EXPECT_TRUE(node_->reports("model", [&](const Diagnostic& d) { return d.values.at("file") == file; }));

  ros::param::set(key, std::string("/nowhere.yaml"));
  const auto refused = node_->call("load_parameters");
  EXPECT_FALSE(refused.success);
  EXPECT_NE(refused.message.find("/torque_estimator/model: "), std::string::npos) << refused.message;
  EXPECT_NE(refused.message.find("/nowhere.yaml"), std::string::npos) << refused.message;
  EXPECT_TRUE(node_->reports("model", [&](const Diagnostic& d) {
    return d.level == warn && d.message.find("nowhere") != std::string::npos && d.values.at("file") == file;
  }));
  ModelFile other = read_model(panda);
  other.robot.joints[0].name = "elsewhere";
  write_model(file, other);
  ros::param::set(key, file);
  EXPECT_FALSE(node_->call("load_parameters").success) << "another robot's";
  stream(200);
  expect_free();

  ros::param::set(key, std::string(panda));
  EXPECT_TRUE(node_->call("load_parameters").success);
  arm_ = std::make_unique<test::Arm>(read_robot(panda));
  std::remove(file.c_str());
}

TEST_F(EstimatorNode, GainsAndThresholdsByReconfiguration) {
  const auto reconfigure = [](double gain, double threshold) {
    dynamic_reconfigure::Reconfigure change;
    dynamic_reconfigure::DoubleParameter one;
    one.name = "gain_factor", one.value = gain;
    change.request.config.doubles.push_back(one);
    one.name = "threshold_factor", one.value = threshold;
    change.request.config.doubles.push_back(one);
    EXPECT_TRUE(ros::service::call("/torque_estimator/set_parameters", change));
  };
  arm_->external[0] = 2.0;
  stream(300);
  EXPECT_FALSE(node_->heard().contact) << "2 N m of 2.8";
  const double before = node_->heard().residual.effort[0];
  reconfigure(1.0, 0.5);
  EXPECT_EQ(stream(300), 300);
  EXPECT_TRUE(node_->heard().contact) << "2 N m of 1.4";
  EXPECT_NEAR(node_->heard().residual.effort[0], before, 0.1);
  // A gain twenty times lower takes twenty times as long.
  reconfigure(0.05, 1.0);
  arm_->external[0] = 0.0;
  stream(2000);
  stream(2000, [](JointState& m, int k) {
    if (k > 1900) m.effort[0] -= 10.0;
  });
  EXPECT_LT(node_->heard().residual.effort[0], 6.0);
  arm_->external[0] = 10.0;
  reconfigure(1.0, 1.0);
  stream(300);
  EXPECT_NEAR(node_->heard().residual.effort[0], 10.0, 0.5);
}

TEST_F(EstimatorNode, PublisherThatDiesAndReturns) {
  const Diagnostic before = node_->diagnostic("input");
  publisher_.reset();
  const int answered = node_->heard().residuals;
  EXPECT_TRUE(node_->reports("input", [](const Diagnostic& d) {
    return d.level == error && d.message.find("no message on /joint_states for") != std::string::npos &&
           d.count("publishers") == 0;
  })) << node_->diagnostic("input").message;
  EXPECT_EQ(node_->heard().residuals, answered);
  publish();
  ASSERT_TRUE(EstimatorClient::wait([] { return publisher_->getNumSubscribers() >= 3; }, 20.0));
  EXPECT_TRUE(answers()) << node_->diagnostic("input").message;
  EXPECT_TRUE(node_->reports(
      "input", [&](const Diagnostic& d) { return d.count("starts") > before.count("starts"); }));
  expect_free();
}

TEST_F(EstimatorNode, TransformsLateAndNever) {
  EXPECT_EQ(stream(100, nullptr, tf_node_.get()), 100);
  // Late: the model's own gravity, and it is said; no wrench in a frame that nobody knows.
  EXPECT_TRUE(tf_node_->reports("frames", [](const Diagnostic& d) {
    return d.level == warn && d.message.find("gravity: waiting for tf") != std::string::npos &&
           d.message.find("wrench: waiting for tf: no transform of tool") != std::string::npos;
  })) << tf_node_->diagnostic("frames").message;
  expect_free(*tf_node_);
  EXPECT_EQ(tf_node_->heard().wrenches, 0);

  // The base hangs from the ceiling; the tool is 0.1 m beyond the flange, turned by 180 degrees about x.
  tf2_ros::StaticTransformBroadcaster broadcaster;
  geometry_msgs::TransformStamped ceiling, tool;
  ceiling.header.frame_id = "world", ceiling.child_frame_id = "panda_link0";
  ceiling.transform.rotation.x = 1.0;
  ceiling.transform.translation.z = 2.0;
  tool.header.frame_id = "panda_link8", tool.child_frame_id = "tool";
  tool.transform.rotation.x = 1.0;
  tool.transform.translation.z = 0.1;
  broadcaster.sendTransform(std::vector<geometry_msgs::TransformStamped>{ceiling, tool});
  EXPECT_TRUE(tf_node_->reports("frames", [](const Diagnostic& d) {
    return d.level == ok &&
           d.values.at("gravity from").find("from tf, world to panda_link0") != std::string::npos &&
           d.values.at("wrench frame") == "tool, carried by panda_link8";
  })) << tf_node_->diagnostic("frames").message;
  arm_->model().set_gravity(Eigen::Vector3d(0.0, 0.0, 9.81));
  EXPECT_EQ(stream(200, nullptr, tf_node_.get()), 200);
  expect_free(*tf_node_);
  EXPECT_TRUE(node_->heard().contact) << "whose gravity still points down";

  // The wrench about the tool's origin and in its axes.
  Eigen::Matrix<double, 6, 1> wrench;
  wrench << 10.0, -6.0, 8.0, 1.0, 0.5, -0.8;  // on the tip, in the axes of the base
  arm_->amplitude = 0.0;
  arm_->at(1.0);
  Workspace<> ws(arm_->model().rigid_body());
  std::vector<Eigen::Isometry3d> poses(8);
  forward_kinematics(arm_->model().rigid_body(), ws, arm_->q(), poses);
  Eigen::Matrix<double, 6, Eigen::Dynamic> J(6, 7);
  jacobian(arm_->model().rigid_body(), ws, arm_->q(), arm_->model().rigid_body().tip(), J);
  arm_->external = J.transpose() * wrench;
  stream(300, nullptr, tf_node_.get());
  EXPECT_GT(tf_node_->heard().wrenches, 0);
  EXPECT_EQ(tf_node_->heard().wrench.header.frame_id, "tool");
  Eigen::Matrix3d turn = poses[7].linear() * Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  const Eigen::Vector3d force = turn.transpose() * wrench.head<3>();
  const Eigen::Vector3d arm = -0.1 * poses[7].linear().col(2),
                        about_tool = wrench.tail<3>() + arm.cross(Eigen::Vector3d(wrench.head<3>()));
  const Eigen::Vector3d moment = turn.transpose() * about_tool;
  const geometry_msgs::Wrench felt = tf_node_->heard().wrench.wrench;
  EXPECT_LT((Eigen::Vector3d(felt.force.x, felt.force.y, felt.force.z) - force).norm(), 0.3) << felt;
  EXPECT_LT((Eigen::Vector3d(felt.torque.x, felt.torque.y, felt.torque.z) - moment).norm(), 0.1)
      << felt << moment.transpose();

  // Never: flagged to the end, the model's gravity in use.
  const Diagnostic never = alone_->diagnostic("frames");
  EXPECT_EQ(never.level, warn);
  EXPECT_NE(never.message.find("no transform from nowhere"), std::string::npos) << never.message;
  arm_->external.setZero();
  arm_->model().set_gravity(Eigen::Vector3d(0.0, 0.0, -9.81));
  EXPECT_EQ(stream(200, nullptr, alone_.get()), 200);
  expect_free(*alone_);
}

TEST_F(EstimatorNode, ResidualAtRest) {
  arm_->amplitude = 0.0;
  arm_->external[0] = 2.0;
  std::thread listener([] {
    EXPECT_TRUE(node_->reports("output", [](const Diagnostic& d) {
      return d.level == warn && d.message.find("N m at rest on panda_joint1") != std::string::npos;
    })) << node_->diagnostic("output").message;
  });
  stream(2000);
  listener.join();
  EXPECT_FALSE(node_->heard().contact);
}

// Not a message to it, but its command line: one line that names the parameter, and it is gone.
TEST_F(EstimatorNode, ParameterOutOfRange) {
  const std::string program =
      "timeout 20 " + directory_of_programs() + "/torque_estimator_node __name:=broken ";
  const auto expect = [&](const std::string& line, const std::string& arguments) {
    std::string output;
    FILE* const pipe = popen((program + arguments + " 2>&1").c_str(), "r");
    ASSERT_NE(pipe, nullptr);
    for (int c; (c = std::fgetc(pipe)) != EOF;) output += static_cast<char>(c);
    const int status = pclose(pipe);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 2) << output;
    EXPECT_NE(output.find("/broken/" + line), std::string::npos) << line << " is not in " << output;
    EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1) << output;
    ros::param::del("/broken");
  };
  const std::string model = std::string("_model:=") + panda + " ";
  expect("model: not set", "");
  expect("model: /nowhere.yaml", "_model:=/nowhere.yaml");
  expect("gain: -1 is not in (0, 1000]", model + "_gain:=-1");
  expect("gain: a list of numbers is needed, such as [0, 0, -9.81], this is the text 'much'",
         model + "_gain:=much");
  expect("contact_release: 1.5 is not in [0, 1]", model + "_contact_release:=1.5");
  expect("acceleration_cutoff: 0 is not in [0.1, 1000]", model + "_acceleration_cutoff:=0");
  expect("acceleration: 'guessed' is none of estimated, zero", model + "_acceleration:=guessed");
  expect("observer_order: 'third' is none of first, second, kalman", model + "_observer_order:=third");
  expect("longest_age: a number is needed, this is a text", model + "_longest_age:=soon");
  expect("bridge: must be less than longest_gap", model + "_bridge:=0.5");
  expect("payload/mass: -2 is not in [0, 1000]", model + "_payload/mass:=-2");
  expect("queue: 0 is not in [1, 1000]", model + "_queue:=0");
  expect("assume: auto: a single sample", model + "_assume:=auto");
  expect("assume: torque_sign: 3 values given, 7 needed (or one for all)",
         model + "_assume:=torque_sign=1,1,-1");
  expect("assume: joint_order: joints are found by name", model + "_assume:=joint_order=2,1,3,4,5,6,7");
  expect("assume: gravity: ~gravity is given too",
         model + "_assume:=gravity=9.81,0,0 _gravity:=\"[0,0,-9.81]\"");
  ros::param::set("/broken/gain", std::vector<double>{1.0, 2.0});
  expect("gain: 1 value or 7 needed, not 2", model);
  ros::param::set("/broken/contact_threshold", std::vector<double>{1, 2, 3, 4, 5, 6, 0});
  expect("contact_threshold: entry 7: 0 is not in (0, 1000]", model);
  ros::param::set("/broken/gravity", std::vector<double>{0, 0});
  expect("gravity: 3 values needed, not 2", model);
  ros::param::set("/broken/gravity", std::vector<double>{0, 0, -1000});
  expect("gravity: entry 3: -1000 is not in [-100, 100]", model);
  ros::param::set("/broken/joint_names", std::vector<std::string>{"a", "b"});
  expect("joint_names: 7 names needed, not 2", model);
}

}  // namespace
}  // namespace dynid

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_estimator_campaign");
  return RUN_ALL_TESTS();
}
