// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/kdl.hpp"

#include <cmath>
#include <set>

#include "conversions.hpp"

namespace dynid {
namespace {

KDL::Vector to_kdl(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

KDL::Frame to_kdl(const Eigen::Isometry3d& pose) {
  const Eigen::Matrix3d R = pose.linear();
  return {KDL::Rotation(R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)),
          to_kdl(Eigen::Vector3d(pose.translation()))};
}

KDL::RotationalInertia to_kdl(const Eigen::Matrix3d& I) {
  return KDL::RotationalInertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
}

KDL::RigidBodyInertia to_kdl(const StandardParameters& p) {
  if (detail::has_centre_of_mass(p)) {
    const LinkInertia link = from_standard(p);
    return KDL::RigidBodyInertia(link.mass, to_kdl(link.com), to_kdl(link.inertia));
  }
  // KDL takes a centre of mass only. Where the mass is too small for one, a unit mass brings the first
  // moments and another, at the origin, takes its mass away again.
  StandardParameters moments = StandardParameters::Zero();
  moments[0] = 1.0;
  moments.segment<3>(1) = p.segment<3>(1);
  const LinkInertia carrier = from_standard(moments);
  return KDL::RigidBodyInertia(1.0, to_kdl(carrier.com), to_kdl(carrier.inertia)) +
         KDL::RigidBodyInertia(p[0] - 1.0, KDL::Vector::Zero(), to_kdl(inertia_tensor(p)));
}

Eigen::Vector3d to_eigen(const KDL::Vector& v) { return {v.x(), v.y(), v.z()}; }

Eigen::Isometry3d to_eigen(const KDL::Frame& frame) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose(i, j) = frame.M(i, j);
    pose(i, 3) = frame.p(i);
  }
  return pose;
}

StandardParameters to_standard(const KDL::RigidBodyInertia& body) {
  StandardParameters p;
  p[0] = body.getMass();
  // KDL gives no first moments h where the mass is zero; the momentum of a body that turns at w, -h x w, has
  // them.
  const KDL::Vector about_x = (body * KDL::Twist(KDL::Vector::Zero(), KDL::Vector(1, 0, 0))).force;
  const KDL::Vector about_y = (body * KDL::Twist(KDL::Vector::Zero(), KDL::Vector(0, 1, 0))).force;
  p.segment<3>(1) << 0.0 - about_y.z(), 0.0 + about_x.z(), 0.0 - about_x.y();  // never -0
  const KDL::RotationalInertia I = body.getRotationalInertia();
  Eigen::Matrix3d J;
  for (int k = 0; k < 9; ++k) J(k / 3, k % 3) = I.data[k];
  set_inertia_tensor(p, J);
  return p;
}

bool moves(const KDL::Segment& segment) { return segment.getJoint().getType() != KDL::Joint::Fixed; }

/// The robot's joint of one moving segment; `in_mover` is the segment's root in the last link's frame at q =
/// 0. `rest` becomes the pose of the segment's tip in the new link's frame.
Joint to_joint(const KDL::Segment& segment, const Eigen::Isometry3d& in_mover, int number,
               Eigen::Isometry3d& rest) {
  const KDL::Joint& source = segment.getJoint();
  const std::string label = "joint " + std::to_string(number) + " ('" + source.getName() + "')";
  const KDL::Twist unit = source.twist(1.0);
  const bool slides = source.getType() == KDL::Joint::TransAxis || source.getType() == KDL::Joint::TransX ||
                      source.getType() == KDL::Joint::TransY || source.getType() == KDL::Joint::TransZ;
  Eigen::Vector3d axis = to_eigen(slides ? unit.vel : unit.rot);  // in the axes of the segment's root
  if (std::abs(axis.norm() - 1.0) > 1e-9) throw Error("KDL chain: " + label + ": its scale is not 1 or -1");
  Eigen::Isometry3d tip = to_eigen(segment.pose(0.0));
  const Eigen::Vector3d offset = tip.translation() - to_eigen(source.JointOrigin());
  const bool off_axis = !slides && axis.cross(offset).norm() > 1e-12 * (1.0 + offset.norm());
  Eigen::Isometry3d frame = tip;
  if (off_axis) frame.translation() = to_eigen(source.JointOrigin());

  Joint joint;
  joint.type = slides ? JointType::prismatic : JointType::revolute;
  joint.origin = in_mover * frame;
  joint.axis = frame.linear().transpose() * axis;
  joint.axis.normalize();
  joint.rotor_inertia = source.getInertia();
  joint.friction.linear.viscous = source.getDamping();
  rest = frame.inverse() * tip;
  return joint;
}

/// `wanted`, or `fallback` where that is no name of its own.
std::string unique_name(const std::string& wanted, const std::string& fallback,
                        std::set<std::string>& names) {
  std::string name = wanted.empty() || wanted == "NoName" || names.count(wanted) != 0 ? fallback : wanted;
  while (!names.insert(name).second) name += "_";
  return name;
}

}  // namespace

KDL::Chain to_kdl(const Robot& robot) {
  validate(robot);
  KDL::Chain chain;
  for (const Joint& joint : robot.joints) {
    const bool slides = joint.type == JointType::prismatic;
    const Eigen::Vector3d axis = joint.origin.linear() * joint.axis;
    const KDL::Joint moving(joint.name, to_kdl(Eigen::Vector3d(joint.origin.translation())), to_kdl(axis),
                            slides ? KDL::Joint::TransAxis : KDL::Joint::RotAxis, 1.0, 0.0,
                            joint.rotor_inertia, joint.friction.linear.viscous);
    chain.addSegment(KDL::Segment(joint.link_name, moving, to_kdl(joint.origin), to_kdl(joint.parameters)));
  }
  if (robot.tip_link != robot.joints.back().link_name || !robot.tip.matrix().isIdentity(0.0)) {
    const KDL::Joint fixed(robot.tip_link + "_joint", KDL::Joint::Fixed);
    chain.addSegment(KDL::Segment(robot.tip_link, fixed, to_kdl(robot.tip)));
  }
  return chain;
}

Robot from_kdl(const KDL::Chain& chain, const std::string& name, const std::string& base_link,
               const Eigen::Vector3d& gravity) {
  Robot robot;
  robot.name = name;
  robot.base_link = base_link;
  robot.gravity = gravity;
  std::set<std::string> joint_names, link_names{base_link};
  Eigen::Isometry3d in_mover =
      Eigen::Isometry3d::Identity();  // the segment's root in the last moving link's frame
  for (const KDL::Segment& segment : chain.segments) {
    if (moves(segment)) {
      const int number = robot.size() + 1;
      Eigen::Isometry3d rest;
      Joint joint = to_joint(segment, in_mover, number, rest);
      joint.name = unique_name(segment.getJoint().getName(), "joint" + std::to_string(number), joint_names);
      joint.link_name = unique_name(segment.getName(), "link" + std::to_string(number), link_names);
      robot.joints.push_back(joint);
      robot.tip_link = joint.link_name;
      in_mover = rest;
    } else {
      in_mover = in_mover * to_eigen(segment.pose(0.0));
      if (!segment.getName().empty() && segment.getName() != "NoName") robot.tip_link = segment.getName();
    }
    if (!robot.joints.empty()) {
      robot.joints.back().parameters += transformed(to_standard(segment.getInertia()), in_mover);
    }
  }
  robot.tip = in_mover;
  try {
    validate(robot);
  } catch (const Error& error) {
    throw Error(std::string("KDL chain: ") + error.what());
  }
  return robot;
}

}  // namespace dynid
