// SPDX-License-Identifier: Apache-2.0
// The simulated arm as the ROS graph sees it: run by plant.test.
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <sys/wait.h>
#include <tf2_msgs/TFMessage.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <memory>

#include "dynid/dynamics/dynamics.hpp"
#include "dynid/model/yaml.hpp"
#include "ros/joint_state.hpp"

namespace dynid::test {
namespace {

using Eigen::VectorXd;

class PlantNode : public ::testing::Test {
 protected:
  struct Sample {
    double t;
    VectorXd q, tau;
  };

  void SetUp() override {
    for (const Joint& joint : robot_.joints) names_.push_back(joint.name);
    reader_ = std::make_unique<JointStateReader>(names_);
    subscribers_ = {
        node_.subscribe<sensor_msgs::JointState>(
            "joint_states", 0,
            [this](const sensor_msgs::JointState::ConstPtr& m) {
              ASSERT_TRUE(reader_->read(*m));
              samples_.push_back({m->header.stamp.toSec(), reader_->q(), reader_->tau()});
              stamps_.push_back(m->header.stamp);
            }),
        node_.subscribe<std_msgs::Bool>("plant/executing", 10,
                                        [this](const std_msgs::Bool::ConstPtr& m) { executing_ = m->data; }),
        node_.subscribe<rosgraph_msgs::Log>("rosout", 100, [this](const rosgraph_msgs::Log::ConstPtr& m) {
          if (m->level >= rosgraph_msgs::Log::WARN) said_ += m->msg + "\n";
        })};
    command_ = node_.advertise<trajectory_msgs::JointTrajectory>("plant/command", 1);
    push_ = node_.advertise<geometry_msgs::WrenchStamped>("plant/push", 1);
    ASSERT_TRUE(until([this] {
      return !samples_.empty() && executing_ >= 0 && command_.getNumSubscribers() > 0 &&
             push_.getNumSubscribers() > 0 && subscribers_[2].getNumPublishers() > 1;
    })) << "the plant is not there";
    // At rest under its load.
    const double start = samples_.back().t;
    ASSERT_TRUE(until([&] { return samples_.back().t > start + 3.0; }));
  }

  template <class F>
  bool until(const F& condition, double seconds = 20.0) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(seconds);
    while (ros::WallTime::now() < end) {
      ros::spinOnce();
      if (condition()) return true;
      ros::WallDuration(0.001).sleep();
    }
    return false;
  }
  void wait(double seconds) {
    until([] { return false; }, seconds);
  }
  VectorXd mean_tau(double seconds) {
    samples_.clear();
    EXPECT_TRUE(until([&] { return !samples_.empty() && samples_.back().t > samples_.front().t + seconds; }));
    VectorXd sum = VectorXd::Zero(7);
    for (const Sample& s : samples_) sum += s.tau;
    return sum / double(samples_.size());
  }
  trajectory_msgs::JointTrajectory to(const VectorXd& goal, double duration) {
    trajectory_msgs::JointTrajectory command;
    command.joint_names = names_;
    command.points.resize(1);
    command.points[0].positions.assign(goal.begin(), goal.end());
    command.points[0].time_from_start.fromSec(duration);
    return command;
  }
  /// Sent, the command changes nothing and is answered by a warning that contains `why`.
  void expect_refused(const trajectory_msgs::JointTrajectory& command, const std::string& why) {
    const VectorXd before = samples_.back().q;
    said_.clear();
    command_.publish(command);
    EXPECT_TRUE(until([&] { return said_.find(why) != std::string::npos; }, 5.0)) << said_;
    EXPECT_NE(said_.find("/plant/command refused: "), std::string::npos) << said_;
    wait(0.3);
    EXPECT_EQ(executing_, 0);
    EXPECT_LT((samples_.back().q - before).cwiseAbs().maxCoeff(), 2e-3);
  }

  Robot robot_ = read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot;
  std::vector<std::string> names_;
  std::unique_ptr<JointStateReader> reader_;
  ros::NodeHandle node_;
  std::vector<ros::Subscriber> subscribers_;
  ros::Publisher command_, push_;
  std::deque<Sample> samples_;
  std::vector<ros::Time> stamps_;
  int executing_ = -1;
  std::string said_;
};

TEST_F(PlantNode, RunsAtATrueKilohertz) {
  stamps_.clear();
  const ros::WallTime start = ros::WallTime::now();
  wait(5.0);
  const double elapsed = (ros::WallTime::now() - start).toSec();
  ASSERT_GT(stamps_.size(), 2u);
  long missed = 0;
  for (std::size_t i = 1; i < stamps_.size(); ++i) {
    const double dt = (stamps_[i] - stamps_[i - 1]).toSec(), periods = std::round(dt / 1e-3);
    ASSERT_GE(periods, 1.0) << "sample " << i;  // none twice, none back
    ASSERT_NEAR(dt, 1e-3 * periods, 2e-6) << "sample " << i;
    missed += std::lround(periods) - 1;
  }
  const double seen = (stamps_.back() - stamps_.front()).toSec();
  EXPECT_NEAR(seen, elapsed, 0.3);  // the wall clock's time
  EXPECT_LT(double(missed), 0.05 * double(stamps_.size()));
  RecordProperty("missed", std::to_string(missed));
}

TEST_F(PlantNode, FollowsATrajectoryFromItsStampOn) {
  const VectorXd from = samples_.back().q;
  VectorXd goal = from;
  goal[0] += 0.4, goal[1] += 0.3, goal[3] += 0.5, goal[6] -= 0.4;
  trajectory_msgs::JointTrajectory command = to(goal, 2.0);
  const ros::Time start = ros::Time::now() + ros::Duration(1.0);
  command.header.stamp = start;
  samples_.clear();
  command_.publish(command);
  ASSERT_TRUE(until([this] { return executing_ == 1; })) << said_;
  ASSERT_TRUE(until([this] { return executing_ == 0; }));
  wait(1.0);
  double worst = 0.0;
  for (const Sample& s : samples_) {
    const double u = std::min(1.0, std::max(0.0, (s.t - start.toSec()) / 2.0));
    const VectorXd expected = from + u * u * u * (10 - 15 * u + 6 * u * u) * (goal - from);
    worst = std::max(worst, (s.q - expected).cwiseAbs().maxCoeff());
  }
  std::printf("  largest error on the way: %.4f rad\n", worst);
  EXPECT_LT(worst, 0.02);
  EXPECT_LT((samples_.back().q - goal).cwiseAbs().maxCoeff(), 2e-3);
  command_.publish(to(from, 2.0));  // and back
  ASSERT_TRUE(until([this] { return executing_ == 1; })) << said_;
  ASSERT_TRUE(until([this] { return executing_ == 0; }));
}

TEST_F(PlantNode, StopsWhenItIsToldTo) {
  const VectorXd from = samples_.back().q;
  VectorXd goal = from;
  goal[0] += 0.5;
  command_.publish(to(goal, 3.0));
  ASSERT_TRUE(until([this] { return executing_ == 1; })) << said_;
  wait(1.0);
  said_.clear();
  command_.publish(to(from, 3.0));  // not in between
  EXPECT_TRUE(until([this] { return said_.find("the arm is moving") != std::string::npos; }, 1.0)) << said_;
  command_.publish(trajectory_msgs::JointTrajectory());
  ASSERT_TRUE(until([this] { return executing_ == 0; }, 1.0));
  EXPECT_LT(samples_.back().q[0] - from[0], 0.45);
  wait(1.0);
  EXPECT_LT((samples_.back().q - from).cwiseAbs().tail(6).maxCoeff(), 5e-3);
  command_.publish(to(from, 2.0));
  ASSERT_TRUE(until([this] { return executing_ == 1; })) << said_;
  ASSERT_TRUE(until([this] { return executing_ == 0; }));
}

TEST_F(PlantNode, RefusesWhatItCannotDo) {
  const VectorXd here = samples_.back().q;
  trajectory_msgs::JointTrajectory command = to(here, 2.0);
  command.joint_names[3] = "elbow";
  expect_refused(command, "joint 'panda_joint4' is missing");
  command = to(here, 2.0);
  command.joint_names.push_back("elbow");
  command.points[0].positions.push_back(0.0);
  expect_refused(command, "joint 'elbow' is not one of the robot's");
  VectorXd goal = here;
  goal[3] = 0.5;
  expect_refused(to(goal, 5.0), "joint 'panda_joint4': position");
  goal = here;
  goal[0] += 2.4;
  expect_refused(to(goal, 1.5), "joint 'panda_joint1': velocity");
  goal = here;
  goal[2] += 0.2;
  command = to(goal, 0.0);
  expect_refused(command, "joint 'panda_joint3': the motion starts at");
  goal[2] = NAN;
  expect_refused(to(goal, 2.0), "point 1: positions of joint 'panda_joint3' are not finite");
}

TEST_F(PlantNode, APushIsInTheEfforts) {
  const Model<> model(robot_);
  Workspace<> ws(model);
  const VectorXd before = mean_tau(1.0);
  geometry_msgs::WrenchStamped push;
  push.header.frame_id = robot_.base_link;
  push.wrench.force.x = 8.0, push.wrench.force.y = 6.0, push.wrench.force.z = -10.0;
  const ros::WallTimer repeat = node_.createWallTimer(
      ros::WallDuration(0.05), [&](const ros::WallTimerEvent&) { push_.publish(push); });
  wait(2.0);
  const VectorXd under = mean_tau(1.0);
  Eigen::MatrixXd J(6, 7);
  jacobian(model, ws, samples_.back().q, robot_.tip, J);
  const VectorXd torque = J.topRows<3>().transpose() * Eigen::Vector3d(8.0, 6.0, -10.0);
  EXPECT_LT((before - under - torque).norm(), 0.05 * torque.norm()) << (before - under).transpose() << "\n"
                                                                    << torque.transpose();
  push.header.frame_id = "table";
  said_.clear();
  EXPECT_TRUE(until([this] { return said_.find("frame 'table'") != std::string::npos; }, 5.0)) << said_;
  wait(3.0);  // nothing renews the push
  EXPECT_LT((mean_tau(1.0) - before).norm(), 0.05 * torque.norm());
}

TEST_F(PlantNode, PublishesTheFramesOfItsLinks) {
  tf2_msgs::TFMessage frames;
  const ros::Subscriber subscriber = node_.subscribe<tf2_msgs::TFMessage>(
      "/tf", 10, [&](const tf2_msgs::TFMessage::ConstPtr& m) { frames = *m; });
  ASSERT_TRUE(until([&] { return !frames.transforms.empty(); }));
  ASSERT_EQ(frames.transforms.size(), 8u);
  Eigen::Isometry3d tip = Eigen::Isometry3d::Identity();
  std::string parent = robot_.base_link;
  for (const geometry_msgs::TransformStamped& t : frames.transforms) {
    EXPECT_EQ(t.header.frame_id, parent);
    parent = t.child_frame_id;
    const auto& x = t.transform.translation;
    const auto& r = t.transform.rotation;
    tip = tip * Eigen::Translation3d(x.x, x.y, x.z) * Eigen::Quaterniond(r.w, r.x, r.y, r.z);
  }
  EXPECT_EQ(parent, robot_.tip_link);
  const Model<> model(robot_);
  Workspace<> ws(model);
  std::vector<Eigen::Isometry3d> poses(8);
  forward_kinematics(model, ws, samples_.back().q, poses);
  EXPECT_LT((tip.matrix() - poses.back().matrix()).norm(), 1e-3);
}

TEST_F(PlantNode, BadParametersEndItWithOneLine) {
  const std::string folder = std::string(DYNID_PROGRAM).substr(0, std::string(DYNID_PROGRAM).rfind('/') + 1);
  const auto run = [&](const std::string& arguments) {
    const std::string command = folder + "plant_node __name:=bad " + arguments + " 2>&1";
    std::string output;
    FILE* const pipe = popen(command.c_str(), "r");
    char line[1000];
    while (fgets(line, sizeof line, pipe) != nullptr) output += line;
    const int status = pclose(pipe);
    node_.deleteParam("/bad");
    EXPECT_TRUE(WIFEXITED(status)) << arguments;
    EXPECT_EQ(WEXITSTATUS(status), 2) << arguments << "\n" << output;
    EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1) << output;
    return output;
  };
  const std::string model = "_model:=" + std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml ";
  EXPECT_NE(run("").find("/bad/model: "), std::string::npos);
  EXPECT_NE(run("_model:=/nowhere.yaml").find("/bad/model: /nowhere.yaml"), std::string::npos);
  EXPECT_NE(run(model + "_rate:=5").find("/bad/rate: 5"), std::string::npos);
  EXPECT_NE(run(model + "_rate:=fast").find("/bad/rate: "), std::string::npos);
  EXPECT_NE(run(model + "_noise:=-1").find("/bad/noise: -1"), std::string::npos);
  EXPECT_NE(run(model + "_effects:=gremlins").find("/bad/effects: gremlins: effect 'gremlins': unknown"),
            std::string::npos);
  EXPECT_NE(run(model + "_initial_position:=1").find("/bad/initial_position: "), std::string::npos);
}

}  // namespace
}  // namespace dynid::test

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_plant_node");
  const ros::NodeHandle handle;
  return RUN_ALL_TESTS();
}
