// SPDX-License-Identifier: Apache-2.0
#include "ros/estimator_frames.hpp"

#include <geometry_msgs/TransformStamped.h>
#include <tf2/exceptions.h>

#include <algorithm>

namespace dynid {

namespace {

constexpr double least_change = 1e-4;  // of gravity, as a part of it
constexpr double standard_gravity = 9.80665;

Eigen::Isometry3d to_eigen(const geometry_msgs::Transform& t) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Eigen::Quaterniond q(t.rotation.w, t.rotation.x, t.rotation.y, t.rotation.z);
  pose.linear() = q.normalized().toRotationMatrix();
  pose.translation() << t.translation.x, t.translation.y, t.translation.z;
  return pose;
}

std::string tf_name(const std::string& prefix, const std::string& link) {
  const std::string name = link.compare(0, 1, "/") == 0 ? link.substr(1) : link;
  return prefix.empty() ? name : prefix + name;
}

}  // namespace

EstimatorFrames::EstimatorFrames(const Robot& robot, const EstimatorFramesOptions& options)
    : options_(options) {
  for (const Joint& joint : robot.joints) links_.push_back(tf_name(options.prefix, joint.link_name));
  links_.push_back(tf_name(options.prefix, robot.tip_link));
  links_.push_back(tf_name(options.prefix, robot.base_link));
  gravity_from_tf_ =
      !options.gravity && !options.gravity_frame.empty() && tf_name("", options.gravity_frame) != name_of(-1);
  set_robot(robot);

  wrench_frame_name_ =
      options.wrench_frame.empty() ? name_of(robot.size()) : tf_name("", options.wrench_frame);
  const int link = link_of(wrench_frame_name_);
  wrench_from_tf_ = link < -1;
  wrench_frame_.known = !wrench_from_tf_;
  wrench_frame_.link = link;
  wrench_text_ = wrench_from_tf_ ? "waiting for tf: no transform of " + wrench_frame_name_ +
                                       " yet, no wrench is published"
                                 : wrench_frame_name_ + ", a link of the model";
}

void EstimatorFrames::set_robot(const Robot& robot) {
  model_gravity_ = robot.gravity;
  if (options_.gravity) {
    gravity_ = *options_.gravity;
    gravity_text_ = "given as a parameter";
  } else if (!gravity_from_tf_) {
    gravity_ = model_gravity_;
    gravity_text_ = "the model's";
  } else if (gravity_text_.empty() || !gravity_known_) {
    gravity_ = model_gravity_;
    gravity_known_ = false;
    gravity_text_ = "waiting for tf: no transform from " + options_.gravity_frame + " to " + name_of(-1) +
                    " yet, the model's own is in use";
  }
}

std::string EstimatorFrames::name_of(int link) const {
  return link < 0 ? links_.back() : links_[static_cast<std::size_t>(link)];
}

// -1 the base, -2 none of them. A tip of the last link's name is that link's frame only if it is called so.
int EstimatorFrames::link_of(const std::string& frame) const {
  if (frame == links_.back()) return -1;
  const auto at = std::find(links_.begin(), links_.end() - 1, frame);
  return at == links_.end() - 1 ? -2 : static_cast<int>(at - links_.begin());
}

bool EstimatorFrames::update(const tf2::BufferCore& tf) {
  bool changed = false;
  if (gravity_from_tf_) {
    try {
      const auto found = tf.lookupTransform(name_of(-1), tf_name("", options_.gravity_frame), ros::Time(0));
      const double g = model_gravity_.norm() > 0.0 ? model_gravity_.norm() : standard_gravity;
      const Eigen::Vector3d now = to_eigen(found.transform).linear() * Eigen::Vector3d(0.0, 0.0, -g);
      if (now.allFinite()) {
        changed = !gravity_known_ || (now - gravity_).norm() > least_change * g;
        if (changed) gravity_ = now;
        gravity_known_ = true;
        gravity_text_ = "from tf, " + options_.gravity_frame + " to " + name_of(-1);
      }
    } catch (const tf2::TransformException&) {
      // What was known is still the best there is.
    }
  }
  if (wrench_from_tf_) find_wrench_frame(tf);
  return changed;
}

void EstimatorFrames::find_wrench_frame(const tf2::BufferCore& tf) {
  try {
    int link = -2;
    std::string frame = wrench_frame_name_, parent;
    for (int step = 0; step < 1000 && link == -2 && tf._getParent(frame, ros::Time(0), parent); ++step) {
      frame = parent;
      link = link_of(frame);
    }
    const bool rests = link == -2;
    if (rests) link = -1;
    const auto found = tf.lookupTransform(name_of(link), wrench_frame_name_, ros::Time(0));
    const Eigen::Isometry3d pose = to_eigen(found.transform);
    if (!pose.matrix().allFinite()) return;
    // A link that tf calls otherwise than the model would pass for a thing at rest until the arm moves.
    if (rests && wrench_frame_.known && wrench_frame_.link == -1 && !pose.isApprox(wrench_frame_.pose, 1e-3))
      wrench_frame_moves_ = true;
    if (rests && wrench_frame_moves_) {
      wrench_frame_.known = false;
      wrench_text_ =
          wrench_frame_name_ + " moves, and no link of the model carries it: no wrench is published";
      return;
    }
    wrench_frame_.known = true;
    wrench_frame_.link = link;
    wrench_frame_.pose = pose;
    wrench_text_ =
        wrench_frame_name_ + (rests ? ", at rest with respect to " : ", carried by ") + name_of(link);
  } catch (const tf2::TransformException&) {
  }
}

}  // namespace dynid
