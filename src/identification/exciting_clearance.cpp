// SPDX-License-Identifier: Apache-2.0
#include "exciting_clearance.hpp"

#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <cmath>
#include <exception>

namespace dynid::detail {
namespace {

bool may_touch(const CollisionModel& model, const std::string& a, const std::string& b) {
  return std::any_of(model.ignore.begin(), model.ignore.end(), [&](const auto& pair) {
    return (pair.first == a && pair.second == b) || (pair.first == b && pair.second == a);
  });
}

}  // namespace

struct Clearances::Shapes {
  struct Body {
    fcl::Capsuled shape{0.0, 0.0};
    int frame = 0;
    Eigen::Isometry3d in_link = Eigen::Isometry3d::Identity();  // FCL's capsule lies along z about its centre
    Eigen::Isometry3d placed = Eigen::Isometry3d::Identity();
    double half_length = 0.0, reach = 0.0;
  };
  struct Obstacle {
    fcl::Boxd shape{1.0, 1.0, 1.0};
    Eigen::Isometry3d placed = Eigen::Isometry3d::Identity();
  };
  std::vector<Body, Eigen::aligned_allocator<Body>> bodies;
  std::vector<Obstacle, Eigen::aligned_allocator<Obstacle>> boxes;
};

Clearances::~Clearances() = default;

Clearances::Clearances(const Robot& robot, const CollisionModel& model)
    : model_(model), shapes_(std::make_unique<Shapes>()) {
  up_ = robot.gravity.norm() > 0.0 ? Eigen::Vector3d(-robot.gravity.normalized()) : Eigen::Vector3d::UnitZ();
  for (const Capsule& capsule : model.capsules) {
    Shapes::Body body;
    const Eigen::Vector3d along = capsule.to - capsule.from;
    body.half_length = 0.5 * along.norm();
    body.reach = body.half_length + capsule.radius;
    body.shape = fcl::Capsuled(capsule.radius, 2.0 * body.half_length);
    body.frame = capsule.frame;
    body.in_link.translation() = 0.5 * (capsule.from + capsule.to);
    if (body.half_length > 0.0)
      body.in_link.linear() =
          Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), along).toRotationMatrix();
    shapes_->bodies.push_back(body);
  }
  for (const BoxObstacle& box : model.boxes) {
    Shapes::Obstacle obstacle;
    obstacle.shape = fcl::Boxd(box.size);
    obstacle.placed.linear() = box.turn.toRotationMatrix();
    obstacle.placed.translation() = box.centre;
    shapes_->boxes.push_back(obstacle);
  }

  // What cannot move against each other, or is joined, is no pair.
  const int n = robot.size(), count = static_cast<int>(model.capsules.size());
  const auto moving = [&](int capsule) {
    return std::min(n, model.capsules[static_cast<std::size_t>(capsule)].frame);
  };
  const auto name = [&](int capsule) { return model.capsules[static_cast<std::size_t>(capsule)].link; };
  for (int a = 0; a < count; ++a)
    for (int b = a + 1; b < count; ++b)
      if (std::abs(moving(a) - moving(b)) >= 2 && !may_touch(model, name(a), name(b)))
        pairs_.push_back({Kind::self_collision, a, b, moving(a), moving(b), name(a), name(b)});
  for (int a = 0; a < count; ++a) {
    if (moving(a) == 0) continue;
    if (model.floor && !may_touch(model, name(a), "floor"))
      pairs_.push_back({Kind::floor, a, 0, moving(a), 0, name(a), "floor"});
    for (int b = 0; b < static_cast<int>(model.boxes.size()); ++b) {
      const std::string& box = model.boxes[static_cast<std::size_t>(b)].name;
      if (!may_touch(model, name(a), box)) pairs_.push_back({Kind::box, a, b, moving(a), 0, name(a), box});
    }
  }
}

void Clearances::near(const std::vector<Eigen::Isometry3d>& poses, double reach,
                      std::vector<Proximity>& out) {
  out.clear();
  for (Shapes::Body& body : shapes_->bodies) {
    if (body.frame == 0)
      body.placed = body.in_link;
    else
      body.placed = poses[static_cast<std::size_t>(body.frame - 1)] * body.in_link;
  }
  fcl::DistanceRequestd request;
  request.enable_nearest_points = true;
  request.enable_signed_distance = true;
  for (int k = 0; k < static_cast<int>(pairs_.size()); ++k) {
    const Pair& pair = pairs_[static_cast<std::size_t>(k)];
    const Shapes::Body& a = shapes_->bodies[static_cast<std::size_t>(pair.a)];
    const double radius = a.shape.radius;
    Proximity near;
    near.pair = k;
    if (pair.kind == Kind::floor) {
      const Eigen::Vector3d half = a.half_length * a.placed.linear().col(2);
      const Eigen::Vector3d lowest =
          a.placed.translation() - (half.dot(up_) > 0.0 ? half : Eigen::Vector3d(-half));
      near.distance = lowest.dot(up_) - radius - *model_.floor;
      near.on_a = lowest - radius * up_;
      near.on_b = near.on_a - near.distance * up_;
      near.normal = -up_;
      if (near.distance < reach) out.push_back(near);
      continue;
    }
    fcl::DistanceResultd result;
    if (pair.kind == Kind::self_collision) {
      const Shapes::Body& b = shapes_->bodies[static_cast<std::size_t>(pair.b)];
      const Eigen::Vector3d between = b.placed.translation() - a.placed.translation();
      if (between.norm() - a.reach - b.reach >= reach) continue;
      near.distance = fcl::distance<double>(&a.shape, a.placed, &b.shape, b.placed, request, result);
      near.on_a = result.nearest_points[0];
      near.on_b = result.nearest_points[1];
    } else {
      const Shapes::Obstacle& box = shapes_->boxes[static_cast<std::size_t>(pair.b)];
      const Eigen::Vector3d centre = box.placed.inverse() * a.placed.translation();
      const Eigen::Vector3d outside = (centre.cwiseAbs() - 0.5 * box.shape.side).cwiseMax(0.0);
      if (outside.norm() - a.reach >= reach) continue;
      try {
        near.distance = fcl::distance<double>(&a.shape, a.placed, &box.shape, box.placed, request, result);
        near.on_a = result.nearest_points[0];
        near.on_b = result.nearest_points[1];
      } catch (const std::exception&) {  // FCL's penetration depth gives up on degenerate contacts
        near.distance = -radius;
        near.on_a = a.placed.translation();
        near.on_b = box.placed.translation();
        near.normal = (near.on_b - near.on_a).normalized();
        out.push_back(near);
        continue;
      }
    }
    // The nearest points of bodies that overlap lie the other way round.
    const Eigen::Vector3d apart = near.on_b - near.on_a;
    const double length = apart.norm();
    near.normal = length > 1e-9 ? Eigen::Vector3d((near.distance < 0.0 ? -1.0 : 1.0) / length * apart)
                                : Eigen::Vector3d::UnitZ();
    if (near.distance < reach) out.push_back(near);
  }
}

}  // namespace dynid::detail
