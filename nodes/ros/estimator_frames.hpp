// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tf2/buffer_core.h>

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "dynid/model/robot.hpp"
#include "ros/estimator_core.hpp"

namespace dynid {

struct EstimatorFramesOptions {
  std::string prefix;                      ///< that tf puts before the names of the model's links
  std::optional<Eigen::Vector3d> gravity;  ///< [m/s^2] in the base frame: tf is not asked
  std::string gravity_frame = "world";     ///< whose z axis points up; empty: the model's gravity is meant
  std::string wrench_frame;                ///< empty: the tip
};

/// What torque_estimator_node learns from tf, beside the loop: gravity in the base frame, and where the frame
/// of the wrench is. Nothing here waits.
///
/// A frame of the wrench is carried by its nearest ancestor in tf that is a link of the model, the base
/// included. Where there is none (a table, the world) it must rest with respect to the base; once it is seen
/// to move, there is no wrench.
class EstimatorFrames {
 public:
  EstimatorFrames(const Robot& robot, const EstimatorFramesOptions& options);

  bool needs_tf() const noexcept { return gravity_from_tf_ || wrench_from_tf_; }
  /// Looks both up; says whether gravity changed.
  bool update(const tf2::BufferCore& tf);
  /// Another model of the same links: its gravity is in use where tf has not told another.
  void set_robot(const Robot& robot);

  const Eigen::Vector3d& gravity() const noexcept { return gravity_; }  ///< [m/s^2] to use
  bool gravity_known() const noexcept { return gravity_known_; }        ///< false: waiting for tf
  const std::string& gravity_text() const noexcept { return gravity_text_; }
  const WrenchFrame& wrench_frame() const noexcept { return wrench_frame_; }
  const std::string& wrench_frame_name() const noexcept { return wrench_frame_name_; }
  const std::string& wrench_text() const noexcept { return wrench_text_; }

 private:
  void find_wrench_frame(const tf2::BufferCore& tf);
  std::string name_of(int link) const;
  int link_of(const std::string& frame) const;

  EstimatorFramesOptions options_;
  std::vector<std::string> links_;  // as tf names them: links base to tip, the tip, and last the base
  Eigen::Vector3d model_gravity_;
  bool gravity_from_tf_ = false, wrench_from_tf_ = false, wrench_frame_moves_ = false;
  bool gravity_known_ = true;
  Eigen::Vector3d gravity_;
  std::string gravity_text_, wrench_frame_name_, wrench_text_;
  WrenchFrame wrench_frame_;
};

}  // namespace dynid
