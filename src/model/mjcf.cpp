// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/mjcf.hpp"

#include <algorithm>
#include <cmath>

#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"

namespace dynid {
namespace {

using Kind = MjcfModel::JointKind;

bool moves_serially(const MjcfModel::Joint& joint) {
  return joint.kind == Kind::hinge || joint.kind == Kind::slide;
}

class MjcfReader {
 public:
  MjcfReader(const MjcfModel& model, std::string name) : m_(model), name_(std::move(name)) {
    children_.resize(m_.bodies.size());
    joints_.resize(m_.bodies.size());
    for (std::size_t b = 1; b < m_.bodies.size(); ++b)
      children_[static_cast<std::size_t>(m_.bodies[b].parent)].push_back(b);
    for (const MjcfModel::Joint& joint : m_.joints)
      joints_[static_cast<std::size_t>(joint.body)].push_back(&joint);
  }

  MjcfRobot read(const std::string& base, const std::string& tip) {
    base_ = base.empty() ? default_base() : body(base, "base");
    const MjcfModel::Site* site = nullptr;
    if (tip.empty()) {
      tip_ = default_tip();
    } else {
      const auto found =
          std::find_if(m_.sites.begin(), m_.sites.end(), [&](const auto& s) { return s.name == tip; });
      const bool is_body =
          std::any_of(m_.bodies.begin(), m_.bodies.end(), [&](const auto& b) { return b.name == tip; });
      if (!is_body && found != m_.sites.end()) site = &*found;
      tip_ = site != nullptr ? static_cast<std::size_t>(site->body) : body(tip, "tip");
    }
    Robot& robot = out_.robot;
    robot.name = m_.name.empty() ? "robot" : m_.name;
    robot.base_link = m_.bodies[base_].name;
    robot.tip_link = site != nullptr ? site->name : m_.bodies[tip_].name;
    robot.gravity = pose_in_world(base_).linear().transpose() * m_.gravity;
    follow();
    if (site != nullptr) robot.tip = robot.tip * site->pose;
    if (robot.joints.empty())
      throw Error(name_ + ": no moving joint between base '" + robot.base_link + "' and tip '" +
                  robot.tip_link + "'");
    take_springs();
    for (std::size_t k = 0; k < moving_.size(); ++k) take_actuators(k);
    list_what_is_left_out();
    return std::move(out_);
  }

 private:
  std::size_t body(const std::string& name, const char* role) const {
    for (std::size_t b = 0; b < m_.bodies.size(); ++b)
      if (m_.bodies[b].name == name) return b;
    throw Error(name_ + ": unknown " + role + " '" + name + "' (bodies: " + names_of_bodies() + ")");
  }

  std::string names_of_bodies() const {
    std::vector<std::string> names;
    for (std::size_t b = 1; b < m_.bodies.size() && names.size() < 20; ++b)
      names.push_back(m_.bodies[b].name);
    return join(names) + (m_.bodies.size() > 21 ? ", ..." : "");
  }

  Eigen::Isometry3d pose_in_world(std::size_t b) const {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    for (; b != 0; b = static_cast<std::size_t>(m_.bodies[b].parent)) pose = m_.bodies[b].pose * pose;
    return pose;
  }

  bool is_free(std::size_t b) const {
    return std::any_of(joints_[b].begin(), joints_[b].end(),
                       [](const auto* j) { return j->kind == Kind::free; });
  }
  bool has_joint(std::size_t b) const {
    return std::any_of(joints_[b].begin(), joints_[b].end(),
                       [](const auto* j) { return j->kind != Kind::free; });
  }
  /// A joint that is not free moves body `b` or one behind it.
  bool moves(std::size_t b) const {
    return has_joint(b) ||
           std::any_of(children_[b].begin(), children_[b].end(), [&](std::size_t c) { return moves(c); });
  }

  std::size_t default_base() const {
    std::vector<std::size_t> fixed, floating;
    for (const std::size_t b : children_[0])
      if (moves(b)) (is_free(b) ? floating : fixed).push_back(b);
    const std::vector<std::size_t>& ways = fixed.empty() ? floating : fixed;
    if (ways.empty()) throw Error(name_ + ": no moving joint (a free joint is none)");
    if (ways.size() > 1) throw Error(name_ + ": there are several robots: choose a base: " + bases(ways));
    return has_joint(ways.front()) ? 0 : ways.front();
  }

  std::string bases(const std::vector<std::size_t>& ways) const {
    std::vector<std::string> names;
    for (const std::size_t b : ways) names.push_back("--base " + m_.bodies[b].name);
    return join(names);
  }

  int depth(std::size_t b) const {
    int most = 0;
    for (const std::size_t c : children_[b]) most = std::max(most, depth(c));
    return most + static_cast<int>(joints_[b].size());
  }

  std::size_t default_tip() const {
    std::size_t at = base_;
    for (;;) {
      std::vector<std::size_t> ways;
      for (const std::size_t c : children_[at])
        if (moves(c) && !is_free(c)) ways.push_back(c);
      if (ways.size() > 1) {
        std::stable_sort(ways.begin(), ways.end(), [&](auto a, auto b) { return depth(a) > depth(b); });
        std::vector<std::string> choices = {"--tip " + m_.bodies[at].name +
                                            " (what is behind it does not move)"};
        for (const std::size_t c : ways)
          choices.push_back("--tip of a body behind '" + m_.bodies[c].name + "' (" +
                            std::to_string(depth(c)) + (depth(c) == 1 ? " joint)" : " joints)"));
        throw Error(name_ + ": moving joints branch at body '" + m_.bodies[at].name +
                    "': choose a tip: " + join(choices));
      }
      if (ways.empty()) {
        if (children_[at].size() != 1 || is_free(children_[at].front())) return at;
        ways = children_[at];
      }
      at = ways.front();
    }
  }

  StandardParameters parameters(std::size_t b, const Eigen::Isometry3d& pose) const {
    const MjcfModel::Body& body = m_.bodies[b];
    LinkInertia link;
    link.mass = body.mass;
    link.com = body.inertial.translation();
    link.inertia =
        body.inertial.linear() * body.principal_moments.asDiagonal() * body.inertial.linear().transpose();
    return transformed(to_standard(link), pose);
  }

  /// Puts body `b`, and all behind it but `next`, into the last link; `pose`: of the body in that link.
  void lump(std::size_t b, const Eigen::Isometry3d& pose, std::size_t next) {
    out_.robot.joints.back().parameters += parameters(b, pose);
    if (m_.bodies[b].gravity_compensation != 0.0) compensated_.push_back(m_.bodies[b].name);
    for (const std::size_t c : children_[b]) {
      if (c == next) continue;
      for (const MjcfModel::Joint* joint : joints_[c]) frozen_.push_back(joint->name);
      lump(c, pose * m_.bodies[c].pose, next);
    }
  }

  void follow() {
    std::vector<std::size_t> way;
    for (std::size_t b = tip_; b != base_; b = static_cast<std::size_t>(m_.bodies[b].parent)) {
      if (b == 0)
        throw Error(name_ + ": tip '" + m_.bodies[tip_].name + "' does not hang from base '" +
                    m_.bodies[base_].name + "'");
      way.insert(way.begin(), b);
    }
    Eigen::Isometry3d in_link = Eigen::Isometry3d::Identity();
    for (std::size_t k = 0; k < way.size(); ++k) {
      const std::size_t b = way[k];
      in_link = in_link * m_.bodies[b].pose;
      for (const MjcfModel::Joint* joint : joints_[b]) in_link = add(*joint, in_link);
      if (!out_.robot.joints.empty()) lump(b, in_link, k + 1 < way.size() ? way[k + 1] : 0);
    }
    out_.robot.tip = in_link;
  }

  /// Adds a joint; `body`: the pose of its body before it moves, in the link so far. Returns the body's pose
  /// in the new link.
  Eigen::Isometry3d add(const MjcfModel::Joint& joint, const Eigen::Isometry3d& body) {
    const std::string& body_name = m_.bodies[static_cast<std::size_t>(joint.body)].name;
    if (!moves_serially(joint))
      throw Error(name_ + ": body '" + body_name + "' has a " + (joint.kind == Kind::ball ? "ball" : "free") +
                  " joint: only hinges and slides are known here");
    Joint link = {};
    link.name = joint.name.empty() ? body_name + "_joint" : joint.name;
    link.link_name = body_name;
    link.type = joint.kind == Kind::slide                                  ? JointType::prismatic
                : std::isfinite(joint.lower) || std::isfinite(joint.upper) ? JointType::revolute
                                                                           : JointType::continuous;
    link.axis = joint.axis.normalized();
    link.origin = body * Eigen::Translation3d(joint.anchor);
    if (joint.reference != 0.0) {
      if (joint.kind == Kind::slide)
        link.origin = link.origin * Eigen::Translation3d(-joint.reference * link.axis);
      else
        link.origin = link.origin * Eigen::AngleAxisd(-joint.reference, link.axis);
    }
    link.limits.lower = joint.lower;
    link.limits.upper = joint.upper;
    link.limits.torque = joint.torque_limit;
    link.friction.linear.viscous = joint.damping;
    link.friction.linear.coulomb = joint.friction_loss;
    link.rotor_inertia = joint.armature;
    for (Joint& other : out_.robot.joints)
      if (other.link_name == body_name) other.link_name += "_" + std::to_string(++of_one_body_);
    out_.robot.joints.push_back(link);
    moving_.push_back(static_cast<int>(&joint - m_.joints.data()));
    return Eigen::Isometry3d(Eigen::Translation3d(-joint.anchor));
  }

  void take_springs() {
    Effect spring;
    spring.name = "joint_spring";
    std::vector<double> stiffness(moving_.size(), 0.0), rest(moving_.size(), 0.0);
    for (std::size_t k = 0; k < moving_.size(); ++k) {
      const MjcfModel::Joint& joint = m_.joints[static_cast<std::size_t>(moving_[k])];
      if (joint.stiffness == 0.0) continue;
      spring.joints.push_back(static_cast<int>(k) + 1);
      stiffness[k] = joint.stiffness;
      rest[k] = joint.rest;
    }
    if (spring.joints.empty()) return;
    spring.parameters = {{"stiffness", stiffness}, {"rest", rest}};
    out_.robot.effects.push_back(spring);
  }

  void take_actuators(std::size_t k) {
    Joint& joint = out_.robot.joints[k];
    double extra_damping = 0.0;
    for (const MjcfModel::Actuator& a : m_.actuators) {
      if (a.joint != moving_[k]) continue;
      const double gear = std::abs(a.gear), limit = gear * std::min(std::abs(a.lower), std::abs(a.upper));
      const bool positions =
          a.affine && a.gain > 0.0 && a.bias[1] < 0.0 && std::abs(a.gain + a.bias[1]) <= 1e-9 * a.gain;
      const bool speeds = a.affine && a.gain != 0.0 && a.bias[1] == 0.0 && a.bias[2] != 0.0;
      const bool motor = a.affine && a.bias[1] == 0.0 && a.bias[2] == 0.0;
      if (a.stateful || (positions && joint.servo) || !(positions || speeds || motor)) {
        say("actuator '" + a.name + "' of joint '" + joint.name +
            "': neither motor, position nor velocity servo" + (joint.servo ? ", or a second servo" : ""));
        continue;
      }
      joint.limits.torque = std::min(joint.limits.torque, limit);
      if (std::isfinite(limit) &&
          std::abs(a.lower + a.upper) > 1e-9 * (std::abs(a.lower) + std::abs(a.upper)))
        say("actuator '" + a.name + "': the larger side of its force range");
      if (speeds) extra_damping += -a.bias[2] * a.gear * a.gear;
      if (!positions) continue;
      Servo servo;
      servo.kp = a.gain * a.gear * a.gear;
      servo.kd = -a.bias[2] * a.gear * a.gear;
      servo.bias = -a.bias[0] / a.gain / a.gear;
      servo.delay = a.delay;
      servo.torque_limit = limit;
      if (a.filtered) servo.command_time_constant = a.time_constant;
      joint.servo = servo;
      if (a.gear != 1.0)
        say("actuator '" + a.name + "': its gear " + short_number(a.gear) +
            " (commands are in the joint's unit)");
    }
    if (joint.servo)
      joint.servo->kd += extra_damping;
    else if (extra_damping != 0.0)
      say("joint '" + joint.name + "': its velocity servo");
  }

  void say(const std::string& text) { out_.not_expressed.push_back(text); }

  void list_what_is_left_out() {
    if (!frozen_.empty()) say("joints beside the chain, frozen at their reference: " + join(frozen_));
    if (!compensated_.empty()) say("gravcomp of bodies: " + join(compensated_));
    if (m_.tendons > 0) say(std::to_string(m_.tendons) + " tendons");
    if (m_.equalities > 0) say(std::to_string(m_.equalities) + " equality constraints");
    if (m_.fluid) say("the medium's density or viscosity");
  }

  const MjcfModel& m_;
  std::string name_;
  std::vector<std::vector<std::size_t>> children_;            ///< of each body
  std::vector<std::vector<const MjcfModel::Joint*>> joints_;  ///< of each body
  std::vector<int> moving_;                                   ///< joints of the chain
  std::vector<std::string> frozen_, compensated_;
  std::size_t base_ = 0, tip_ = 0;
  int of_one_body_ = 0;
  MjcfRobot out_;
};

}  // namespace

MjcfRobot robot_of(const MjcfModel& model, const std::string& name, const std::string& base,
                   const std::string& tip) {
  return MjcfReader(model, name).read(base, tip);
}

}  // namespace dynid
