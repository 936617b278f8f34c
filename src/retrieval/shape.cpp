// SPDX-License-Identifier: Apache-2.0
#include "dynid/retrieval/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynid/base/error.hpp"
#include "hull.hpp"

namespace dynid {

namespace {

void require_shape(bool holds, const std::string& rule) {
  if (!holds) throw Error("link shape: " + rule);
}

/// c^T Q c + g^T c + d of the centre of mass of link i, with its derivatives.
Inequality quadratic(int i, const Eigen::Matrix3d& Q, const Eigen::Vector3d& g, double d) {
  Inequality h;
  const int at = 10 * i + 1;
  h.variables = {at, at + 1, at + 2};
  h.value = [=](const Eigen::VectorXd& p) {
    const Eigen::Vector3d c = p.segment<3>(at);
    return c.dot(Q * c) + g.dot(c) + d;
  };
  h.gradient = [=](const Eigen::VectorXd& p) -> Eigen::VectorXd { return 2.0 * Q * p.segment<3>(at) + g; };
  h.hessian = [=](const Eigen::VectorXd&) -> Eigen::MatrixXd { return 2.0 * Q; };
  return h;
}

}  // namespace

Shape Shape::box(const Eigen::Isometry3d& pose, const Eigen::Vector3d& half) {
  require_shape(half.allFinite() && half.minCoeff() > 0.0 && pose.matrix().allFinite(),
                "a box has a size that is not > 0");
  Shape shape;
  for (int a = 0; a < 3; ++a) {
    const Eigen::Vector3d axis = pose.linear().col(a);
    const double middle = axis.dot(pose.translation());
    shape.planes_.push_back({axis, middle + half[a]});
    shape.planes_.push_back({-axis, half[a] - middle});
  }
  return shape;
}

Shape Shape::box(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = 0.5 * (lower + upper);
  return box(pose, 0.5 * (upper - lower));
}

Shape Shape::sphere(const Eigen::Vector3d& centre, double radius) {
  require_shape(centre.allFinite() && std::isfinite(radius) && radius > 0.0,
                "a sphere has a radius that is not > 0");
  Shape shape;
  shape.rounds_.push_back({centre, Eigen::Vector3d::Zero(), radius, 0.0});
  return shape;
}

Shape Shape::cylinder(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius) {
  return truncated_cone(from, to, radius, radius);
}

Shape Shape::truncated_cone(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius_from,
                            double radius_to) {
  const double length = (to - from).norm();
  require_shape(std::isfinite(length) && length > 0.0, "a cylinder or cone has no length");
  require_shape(std::isfinite(radius_from) && std::isfinite(radius_to) && radius_from >= 0.0 &&
                    radius_to >= 0.0 && radius_from + radius_to > 0.0,
                "a cylinder or cone has a radius that is not > 0");
  const Eigen::Vector3d axis = (to - from) / length;
  Shape shape;
  shape.planes_.push_back({axis, axis.dot(to)});
  shape.planes_.push_back({-axis, -axis.dot(from)});
  shape.rounds_.push_back({from, axis, radius_from, (radius_to - radius_from) / length});
  return shape;
}

Shape Shape::hull(const std::vector<Eigen::Vector3d>& points) {
  Shape shape;
  for (const auto& [normal, offset] : detail::hull_planes(points)) shape.planes_.push_back({normal, offset});
  return shape;
}

Shape Shape::mesh(const std::string& path, const Eigen::Isometry3d& pose, const Eigen::Vector3d& scale) {
  std::vector<Eigen::Vector3d> points = detail::mesh_vertices(path);
  for (Eigen::Vector3d& point : points) point = pose * scale.cwiseProduct(point);
  try {
    return hull(points);
  } catch (const Error& error) {
    throw Error(path + ": " + error.what());
  }
}

double Shape::clearance(const Eigen::Vector3d& c) const {
  double least = std::numeric_limits<double>::infinity();
  for (const Plane& plane : planes_) least = std::min(least, plane.offset - plane.normal.dot(c));
  for (const Round& round : rounds_) {
    const Eigen::Vector3d from = c - round.point;
    const double along = round.axis.dot(from);
    least = std::min(least, round.radius + round.slope * along - (from - along * round.axis).norm());
  }
  return least;
}

Constraint Shape::contains_com(const std::string& name, int link) const {
  require_shape(link >= 1, "links are numbered from 1");
  const int i = link - 1;
  Alternative inside;
  for (const Plane& plane : planes_)
    inside.required.push_back(quadratic(i, Eigen::Matrix3d::Zero(), -plane.normal, plane.offset));
  for (const Round& round : rounds_) {
    // (r^2 - rho^2) / 2R: of the sign of r - rho, and as steep where they are equal, but smooth on the axis.
    const double size = 2.0 * std::max(round.radius, 1e-3);
    const Eigen::Vector3d a = round.axis, slope = round.slope * a;
    const double at_zero = round.radius - slope.dot(round.point);  // r(c) = at_zero + slope . c
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - a * a.transpose();
    const Eigen::Matrix3d Q = (slope * slope.transpose() - across) / size;
    const Eigen::Vector3d g = 2.0 * (at_zero * slope + across * round.point) / size;
    const double d = (at_zero * at_zero - round.point.dot(across * round.point)) / size;
    inside.required.push_back(quadratic(i, Q, g, d));
  }
  Constraint constraint{name, {inside}, {}, true};
  constraint.exact = [shape = *this, i](const Eigen::VectorXd& p) {
    return shape.clearance(p.segment<3>(10 * i + 1));
  };
  return constraint;
}

}  // namespace dynid
