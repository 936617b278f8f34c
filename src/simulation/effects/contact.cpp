// SPDX-License-Identifier: Apache-2.0
// external_contact: a force on a point of a link, in the axes of the base frame, for some time.
#include <cmath>

#include "dynid/base/error.hpp"
#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class ExternalContact : public EffectModel {
 public:
  ExternalContact(const Effect& effect, const Robot& robot)
      : link_(static_cast<int>(std::lround(value(effect, "link"))) - 1),
        point_(values(effect, "point")),
        force_(values(effect, "force")),
        start_(value(effect, "start")),
        end_(start_ + value(effect, "duration")),
        rise_(value(effect, "rise_time")) {
    if (link_ >= robot.size())
      throw Error("effect 'external_contact': link: the robot has no link " + std::to_string(link_ + 1));
    for (int i = 0; i <= link_; ++i) {
      const Joint& joint = robot.joints[static_cast<std::size_t>(i)];
      axis_.push_back(joint.axis);
      revolute_.push_back(joint.type != JointType::prismatic);
    }
  }
  bool acts() const override { return true; }
  bool needs_poses(double t) const override { return t > start_ && t < end_; }
  void add_torque(const JointView& at, Eigen::VectorXd& tau) const override {
    if (!needs_poses(at.t)) return;
    const Eigen::Vector3d force = size(at.t) * force_;
    const Eigen::Vector3d p = at.link[static_cast<std::size_t>(link_)] * point_;
    for (int i = 0; i <= link_; ++i) {
      const Eigen::Isometry3d& pose = at.link[static_cast<std::size_t>(i)];
      const Eigen::Vector3d axis = pose.linear() * axis_[static_cast<std::size_t>(i)];
      // The force helps the motor by J^T F, so the motor's torque is less by as much.
      tau[i] -= revolute_[static_cast<std::size_t>(i)] ? axis.dot((p - pose.translation()).cross(force))
                                                       : axis.dot(force);
    }
  }

 private:
  double size(double t) const {  // rises and falls as half a cosine
    const double rise = std::min(rise_, 0.5 * (end_ - start_)), edge = std::min(t - start_, end_ - t);
    return edge < rise ? 0.5 - 0.5 * std::cos(M_PI * edge / rise) : 1.0;
  }

  int link_;
  Eigen::Vector3d point_, force_;
  double start_, end_, rise_;
  std::vector<Eigen::Vector3d> axis_;
  std::vector<bool> revolute_;
};

void draw_contact(Effect& effect, const Robot& robot, std::mt19937_64& random, double, double duration) {
  const int n = robot.size();
  const int link = std::uniform_int_distribution<int>(std::max(1, n - 3), n)(random);
  effect.joints.clear();
  for (int j = 1; j <= link; ++j) effect.joints.push_back(j);
  effect.parameters["link"] = {double(link)};
  const double length = duration * uniform(random, 0.05, 0.15);
  effect.parameters["duration"] = {length};
  effect.parameters["start"] = {uniform(random, 0.15, 0.85) * (duration - length)};
}

}  // namespace

std::vector<EffectDefinition> contact_effects() {
  return {
      {"external_contact",
       {{"link", {4.0}, {7.0}, false, Scale::none},
        {"point", {-0.08, -0.08, -0.08}, {0.08, 0.08, 0.08}, false, Scale::none},
        {"force", {8.0, 8.0, 8.0}, {25.0, 25.0, 25.0}, true, Scale::times},
        {"start", {2.0}, {15.0}, false, Scale::none},
        {"duration", {1.0}, {3.0}, false, Scale::none},
        {"rise_time", {0.01}, {0.05}, false, Scale::none}},
       &make_model<ExternalContact>,
       &draw_contact},
  };
}

}  // namespace dynid::detail
