// SPDX-License-Identifier: Apache-2.0
#include "exciting_clearance.hpp"

#include <fcl/geometry/shape/capsule.h>
#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <cmath>

namespace dynid::detail {
namespace {

bool may_touch(const CollisionModel& model, const std::string& a, const std::string& b) {
  return std::any_of(model.ignore.begin(), model.ignore.end(), [&](const auto& pair) {
    return (pair.first == a && pair.second == b) || (pair.first == b && pair.second == a);
  });
}

/// Signed distance of a point to a box about the origin: negative inside. A convex function.
double box_distance(const Eigen::Vector3d& point, const Eigen::Vector3d& half_size) {
  const Eigen::Vector3d beyond = point.cwiseAbs() - half_size;
  return beyond.cwiseMax(0.0).norm() + std::min(0.0, beyond.maxCoeff());
}

/// Its gradient, a unit vector.
Eigen::Vector3d away_from_box(const Eigen::Vector3d& point, const Eigen::Vector3d& half_size) {
  const Eigen::Vector3d beyond = point.cwiseAbs() - half_size;
  Eigen::Vector3d direction = beyond.cwiseMax(0.0);
  Eigen::Index nearest = 0;
  if (beyond.maxCoeff(&nearest) <= 0.0) direction = Eigen::Vector3d::Unit(nearest);
  for (int k = 0; k < 3; ++k) direction[k] = std::copysign(direction[k], point[k]);
  return direction.normalized();
}

/// The segment centre -+ along against a box: the nearest point (by golden section: the distance is convex
/// along the segment) and how the distance changes with it, which is level along the segment unless the point
/// is an end. Inside the box, where the nearest face changes at the deepest point, that is a mean of both
/// faces.
struct NearestToBox {
  Eigen::Vector3d point, gradient;

  NearestToBox(const Eigen::Vector3d& centre, const Eigen::Vector3d& along,
               const Eigen::Vector3d& half_size) {
    const auto on = [&](double s) -> Eigen::Vector3d { return centre + s * along; };
    const auto at = [&](double s) { return box_distance(on(s), half_size); };
    constexpr double golden = 0.38196601125010515;
    double low = -1.0, high = 1.0, s = low + golden * (high - low), t = high - golden * (high - low);
    double at_s = at(s), at_t = at(t);
    for (int k = 0; k < 50; ++k) {
      if (at_s < at_t) {
        high = t, t = s, at_t = at_s;
        at_s = at(s = low + golden * (high - low));
      } else {
        low = s, s = t, at_s = at_t;
        at_t = at(t = high - golden * (high - low));
      }
    }
    const double best = 0.5 * (low + high);
    point = on(best);
    constexpr double aside = 1e-6;
    const Eigen::Vector3d before = away_from_box(on(best - aside), half_size),
                          after = away_from_box(on(best + aside), half_size);
    const double falling = before.dot(along), rising = after.dot(along);
    gradient = away_from_box(point, half_size);
    if (std::abs(best) < 1.0 - aside && falling < 0.0 && rising > 0.0)
      gradient = (rising * before - falling * after) / (rising - falling);
  }
};

}  // namespace

struct Clearances::Shapes {
  struct Body {
    fcl::Capsuled shape{0.0, 0.0};
    int frame = 0;
    Eigen::Isometry3d in_link = Eigen::Isometry3d::Identity();  // FCL's capsule lies along z about its centre
    Eigen::Isometry3d placed = Eigen::Isometry3d::Identity();
    double half_length = 0.0, reach = 0.0;
  };
  std::vector<Body, Eigen::aligned_allocator<Body>> bodies;
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
  // FCL has two capsules' distance in closed form, negative where they overlap. (A signed distance that is
  // asked for by name is iterated, and asserts in degenerate contacts.)
  fcl::DistanceRequestd request;
  request.enable_nearest_points = true;
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
    if (pair.kind == Kind::box) {
      const BoxObstacle& box = model_.boxes[static_cast<std::size_t>(pair.b)];
      const Eigen::Matrix3d axes = box.turn.toRotationMatrix();
      const Eigen::Vector3d centre = axes.transpose() * (a.placed.translation() - box.centre);
      const Eigen::Vector3d half_size = 0.5 * box.size,
                            outside = (centre.cwiseAbs() - half_size).cwiseMax(0.0);
      if (outside.norm() - a.reach >= reach) continue;
      const Eigen::Vector3d along = a.half_length * (axes.transpose() * a.placed.linear().col(2));
      const NearestToBox nearest(centre, along, half_size);
      near.distance = box_distance(nearest.point, half_size) - radius;
      near.normal = -(axes * nearest.gradient);
      near.on_a = box.centre + axes * nearest.point;  // an offset along the normal does not matter
      near.on_b = near.on_a;
      if (near.distance < reach) out.push_back(near);
      continue;
    }
    fcl::DistanceResultd result;
    const Shapes::Body& b = shapes_->bodies[static_cast<std::size_t>(pair.b)];
    const Eigen::Vector3d between = b.placed.translation() - a.placed.translation();
    if (between.norm() - a.reach - b.reach >= reach) continue;
    near.distance = fcl::distance<double>(&a.shape, a.placed, &b.shape, b.placed, request, result);
    near.on_a = result.nearest_points[0];
    near.on_b = result.nearest_points[1];
    // The nearest points of bodies that overlap lie the other way round.
    const Eigen::Vector3d apart = near.on_b - near.on_a;
    const double length = apart.norm();
    near.normal = length > 1e-9 ? Eigen::Vector3d((near.distance < 0.0 ? -1.0 : 1.0) / length * apart)
                                : Eigen::Vector3d::UnitZ();
    if (near.distance < reach) out.push_back(near);
  }
}

}  // namespace dynid::detail
