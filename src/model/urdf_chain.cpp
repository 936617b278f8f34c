// SPDX-License-Identifier: Apache-2.0
#include "urdf_chain.hpp"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <map>
#include <mutex>

#include "dynid/base/error.hpp"

namespace dynid::detail {

Eigen::Isometry3d to_eigen(const urdf::Pose& pose) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << pose.position.x, pose.position.y, pose.position.z;
  const urdf::Rotation& r = pose.rotation;
  T.linear() = Eigen::Quaterniond(r.w, r.x, r.y, r.z).normalized().toRotationMatrix();
  return T;
}

namespace {

/// Keeps what urdfdom would print, while it lives.
class CapturedLog : public console_bridge::OutputHandler {
 public:
  CapturedLog() : lock_(mutex()) { console_bridge::useOutputHandler(this); }
  ~CapturedLog() override { console_bridge::restorePreviousOutputHandler(); }

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level != console_bridge::CONSOLE_BRIDGE_LOG_ERROR) return;
    if (!errors_.empty()) errors_ += "; ";
    for (const char c : text) errors_ += c == '\n' ? ' ' : c;
  }
  const std::string& errors() const { return errors_; }

 private:
  static std::mutex& mutex() {  // the handler is one for the whole process
    static std::mutex instance;
    return instance;
  }
  std::lock_guard<std::mutex> lock_;
  std::string errors_;
};

bool is_fixed(const urdf::Joint& joint) { return joint.type == urdf::Joint::FIXED; }

/// True where a joint that is not fixed hangs from `joint`, or is `joint`.
bool moves(const urdf::ModelInterface& model, const urdf::Joint& joint) {
  if (!is_fixed(joint)) return true;
  for (const auto& child : model.getLink(joint.child_link_name)->child_joints) {
    if (moves(model, *child)) return true;
  }
  return false;
}

void collect_leaves(const urdf::Link& link, std::string& names) {
  if (link.child_links.empty()) names += (names.empty() ? "'" : ", '") + link.name + "'";
  for (const auto& child : link.child_links) collect_leaves(*child, names);
}

class Reader {
 public:
  Reader(const std::string& text, const std::string& name, bool collision) : name_(name) {
    chain_.elements = index_xml(text, name);
    check_kind();
    check_tree();
    const CapturedLog log;
    try {
      model_ = urdf::parseURDF(without_looks(text, collision));
    } catch (const std::exception& error) {
      throw Error(name + ": " + error.what());
    }
    // urdfdom may complain about an inertial and go on with half of it.
    if (!log.errors().empty()) throw Error(name + ": " + log.errors());
    if (!model_ || !model_->getRoot()) throw Error(name + ": is not a URDF");
  }

  UrdfChain read(const std::string& base, const std::string& tip) {
    const urdf::LinkConstSharedPtr base_link = base.empty() ? model_->getRoot() : link(base, "base");
    const urdf::LinkConstSharedPtr tip_link = tip.empty() ? default_tip(base_link) : link(tip, "tip");
    chain_.robot_name = model_->getName();
    chain_.base = base_link->name;
    chain_.tip = tip_link->name;
    for (urdf::LinkConstSharedPtr l = base_link; l->parent_joint; l = l->getParent()) {
      chain_.base_pose = to_eigen(l->parent_joint->parent_to_joint_origin_transform) * chain_.base_pose;
    }
    follow(path(base_link, tip_link));
    if (chain_.joints.empty()) {
      throw Error(name_ + ": no moving joint between base '" + chain_.base + "' and tip '" + chain_.tip +
                  "'");
    }
    return std::move(chain_);
  }

 private:
  [[noreturn]] void fail(const char* tag, const std::string& element, const std::string& what) const {
    const XmlElement* found = find_named(chain_.elements, tag, element);
    throw Error(name_ + (found != nullptr ? ":" + std::to_string(found->line) : "") + ": " + tag + " '" +
                element + "': " + what);
  }

  /// The text without what a robot looks like: nothing wrong in there matters here.
  std::string without_looks(const std::string& text, bool collision) const {
    std::string rest;
    std::size_t kept = 0;
    for (const XmlElement& element : chain_.elements) {
      const bool looks =
          element.tag == "visual" || element.tag == "material" || (element.tag == "collision" && !collision);
      if (!looks || element.begin < kept) continue;
      rest.append(text, kept, element.begin - kept);
      kept = element.end;
    }
    return rest.append(text, kept, std::string::npos);
  }

  /// What is not a URDF yet, or never was one.
  void check_kind() const {
    const std::string& root = chain_.elements.front().tag;
    if (root == "sdf")
      throw Error(name_ +
                  ": this is an SDF: give the URDF that it was made from, or convert it (sdformat_urdf)");
    for (const XmlElement& element : chain_.elements) {
      bool macro = element.tag.compare(0, 6, "xacro:") == 0;
      for (const auto& [key, value] : element.attributes)
        macro = macro || value.find("${") != std::string::npos || value.find("$(") != std::string::npos;
      if (macro)
        throw Error(name_ + ":" + std::to_string(element.line) +
                    ": unexpanded xacro: expand it first, `xacro FILE > robot.urdf`");
    }
  }

  /// A link that two joints carry is no error for urdfdom, and a closed ring one that names nothing.
  void check_tree() const {
    std::map<std::string, std::pair<std::string, std::string>> up;  // link -> (joint, its parent link)
    for (std::size_t k = 0; k < chain_.elements.size(); ++k) {
      const XmlElement& joint = chain_.elements[k];
      if (joint.parent != 0 || joint.tag != "joint") continue;
      std::string parent, child;
      for (std::size_t j = k + 1; j < chain_.elements.size() && chain_.elements[j].begin < joint.end; ++j) {
        const XmlElement& element = chain_.elements[j];
        if (element.parent != static_cast<int>(k)) continue;
        if (element.tag == "parent") parent = element.attribute("link");
        if (element.tag == "child") child = element.attribute("link");
      }
      const std::string joint_name = joint.attribute("name");
      const auto [other, inserted] = up.insert({child, {joint_name, parent}});
      if (!inserted && !child.empty()) {
        fail("joint", joint_name,
             "link '" + child + "' hangs from joint '" + other->second.first +
                 "' already: a loop, not a tree");
      }
    }
    for (const auto& entry : up) {
      auto at = up.find(entry.first);
      // After as many steps as there are joints only a ring is left to walk in.
      for (std::size_t steps = 0; steps < up.size() && at != up.end(); ++steps)
        at = up.find(at->second.second);
      if (at != up.end()) fail("joint", at->second.first, "is part of a loop");
    }
  }

  urdf::LinkConstSharedPtr link(const std::string& link_name, const char* role) const {
    urdf::LinkConstSharedPtr found = model_->getLink(link_name);
    if (!found) {
      throw Error(name_ + ": unknown " + role + " link '" + link_name +
                  "' (leaves: " + leaves(*model_->getRoot()) + ")");
    }
    return found;
  }

  static std::string leaves(const urdf::Link& from) {
    std::string names;
    collect_leaves(from, names);
    return names;
  }

  /// Joints on the longest way from `link` outwards.
  int depth(const urdf::Link& link) const {
    int most = 0;
    for (const auto& joint : link.child_joints)
      most = std::max(most, (is_fixed(*joint) ? 0 : 1) + depth(*model_->getLink(joint->child_link_name)));
    return most;
  }

  /// The tips of the arms beyond `at`, `joints` from the base: a link beyond which there are only short
  /// branches (the fingers of a hand), or nothing that moves.
  void collect_tips(urdf::LinkConstSharedPtr at, int joints,
                    std::vector<std::pair<std::string, int>>& tips) const {
    constexpr int finger = 3;  // joints, at most
    for (;;) {
      std::vector<urdf::JointConstSharedPtr> ways;
      for (const auto& joint : at->child_joints)
        if (moves(*model_, *joint)) ways.push_back(joint);
      const auto beyond = [&](const urdf::JointConstSharedPtr& joint) {
        return (is_fixed(*joint) ? 0 : 1) + depth(*model_->getLink(joint->child_link_name));
      };
      if (ways.size() > 1) {
        bool arms = joints == 0;  // a hand alone has fingers for arms
        for (const auto& joint : ways) arms = arms || beyond(joint) > finger;
        if (arms) {
          for (const auto& joint : ways)
            if (joints == 0 || beyond(joint) > finger)
              collect_tips(model_->getLink(joint->child_link_name), joints + (is_fixed(*joint) ? 0 : 1),
                           tips);
          return;
        }
      }
      if (ways.size() != 1) {
        tips.emplace_back(at->name, joints);
        return;
      }
      joints += is_fixed(*ways.front()) ? 0 : 1;
      at = model_->getLink(ways.front()->child_link_name);
    }
  }

  /// `--tip left_hand (7 joints), ...`, the longest arms first.
  std::string tips(const urdf::LinkConstSharedPtr& base) const {
    std::vector<std::pair<std::string, int>> list;
    collect_tips(base, 0, list);
    std::stable_sort(list.begin(), list.end(),
                     [](const auto& a, const auto& b) { return a.second > b.second; });
    std::string text;
    for (std::size_t k = 0; k < list.size() && k < 6; ++k)
      text += (k ? ", " : "") + ("--tip " + list[k].first) + " (" + std::to_string(list[k].second) +
              (list[k].second == 1 ? " joint)" : " joints)");
    return text + (list.size() > 6 ? ", ..." : "");
  }

  urdf::LinkConstSharedPtr default_tip(urdf::LinkConstSharedPtr at) const {
    const urdf::LinkConstSharedPtr base = at;
    for (;;) {
      urdf::JointConstSharedPtr next;
      int ways = 0;
      for (const auto& joint : at->child_joints) {
        if (!moves(*model_, *joint)) continue;
        next = joint;
        ++ways;
      }
      if (ways > 1) {
        throw Error(name_ + ": moving joints branch at link '" + at->name +
                    "': choose a base and a tip: " + tips(base));
      }
      if (ways == 0) {
        if (at->child_joints.size() != 1) return at;
        next = at->child_joints.front();
      }
      at = model_->getLink(next->child_link_name);
    }
  }

  /// The joints from `base` to `tip`.
  std::vector<urdf::JointConstSharedPtr> path(const urdf::LinkConstSharedPtr& base,
                                              const urdf::LinkConstSharedPtr& tip) const {
    std::vector<urdf::JointConstSharedPtr> joints;
    for (urdf::LinkConstSharedPtr at = tip; at != base; at = at->getParent()) {
      if (!at->parent_joint) {
        throw Error(name_ + ": tip link '" + tip->name + "' does not hang from base link '" + base->name +
                    "' (leaves: " + leaves(*base) + ")");
      }
      joints.insert(joints.begin(), at->parent_joint);
    }
    return joints;
  }

  void follow(const std::vector<urdf::JointConstSharedPtr>& joints) {
    Eigen::Isometry3d in_mover =
        Eigen::Isometry3d::Identity();  // the current link in the last moving link's frame
    for (std::size_t k = 0; k < joints.size(); ++k) {
      const urdf::Joint& joint = *joints[k];
      const urdf::LinkConstSharedPtr child = model_->getLink(joint.child_link_name);
      const urdf::Joint* next = k + 1 < joints.size() ? joints[k + 1].get() : nullptr;
      in_mover = in_mover * to_eigen(joint.parent_to_joint_origin_transform);
      if (!is_fixed(joint)) {
        check_moving(joint);
        UrdfJoint moving;
        moving.joint = joints[k];
        moving.link = child;
        moving.origin = in_mover;
        moving.bodies.push_back({child, Eigen::Isometry3d::Identity()});
        chain_.joints.push_back(moving);
        in_mover.setIdentity();
      } else if (!chain_.joints.empty()) {
        lump(child, in_mover, chain_.joints.back());
      }
      if (!chain_.joints.empty()) lump_branches(*child, next, in_mover, chain_.joints.back());
    }
    chain_.tip_pose = in_mover;
  }

  void check_moving(const urdf::Joint& joint) const {
    if (joint.type != urdf::Joint::REVOLUTE && joint.type != urdf::Joint::CONTINUOUS &&
        joint.type != urdf::Joint::PRISMATIC) {
      fail("joint", joint.name, "is neither revolute, continuous, prismatic nor fixed");
    }
    if (joint.mimic) {
      fail(
          "joint", joint.name,
          "mimics joint '" + joint.mimic->joint_name + "': a coupled joint cannot be part of a serial chain");
    }
    const urdf::Vector3& a = joint.axis;
    if (!(Eigen::Vector3d(a.x, a.y, a.z).norm() > 1e-9))
      fail("joint", joint.name, "its axis has no direction");
  }

  static void lump(const urdf::LinkConstSharedPtr& link, const Eigen::Isometry3d& in_mover,
                   UrdfJoint& mover) {
    mover.lumped += transformed(own_parameters(*link), in_mover);
    mover.bodies.push_back({link, in_mover});
  }

  /// Adds the bodies beyond every child joint of `link` but `except`, joints at zero; `in_mover` is the
  /// link's pose.
  void lump_branches(const urdf::Link& link, const urdf::Joint* except, const Eigen::Isometry3d& in_mover,
                     UrdfJoint& mover) const {
    for (const auto& joint : link.child_joints) {
      if (joint.get() == except) continue;
      const urdf::LinkConstSharedPtr child = model_->getLink(joint->child_link_name);
      const Eigen::Isometry3d pose = in_mover * to_eigen(joint->parent_to_joint_origin_transform);
      lump(child, pose, mover);
      lump_branches(*child, nullptr, pose, mover);
    }
  }

  std::string name_;
  urdf::ModelInterfaceSharedPtr model_;
  UrdfChain chain_;
};

}  // namespace

UrdfChain read_chain(const std::string& text, const std::string& name, const std::string& base,
                     const std::string& tip, bool collision) {
  return Reader(text, name, collision).read(base, tip);
}

StandardParameters own_parameters(const urdf::Link& link) {
  if (!link.inertial) return StandardParameters::Zero();
  const urdf::Inertial& inertial = *link.inertial;
  const Eigen::Isometry3d pose = to_eigen(inertial.origin);
  Eigen::Matrix3d I;
  I << inertial.ixx, inertial.ixy, inertial.ixz, inertial.ixy, inertial.iyy, inertial.iyz, inertial.ixz,
      inertial.iyz, inertial.izz;
  return to_standard({inertial.mass, pose.translation(), pose.linear() * I * pose.linear().transpose()});
}

const XmlElement* find_named(const std::vector<XmlElement>& elements, const char* tag,
                             const std::string& name) {
  for (const XmlElement& element : elements) {
    if (element.parent == 0 && element.tag == tag && element.attribute("name") == name) return &element;
  }
  return nullptr;
}

}  // namespace dynid::detail
