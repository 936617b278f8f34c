// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "../model/urdf_chain.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/retrieval/collision_box.hpp"
#include "dynid/retrieval/shape.hpp"
#include "hull.hpp"

namespace dynid {

namespace {

namespace fs = std::filesystem;
using Points = std::vector<Eigen::Vector3d>;

constexpr double pi = 3.14159265358979323846;
constexpr int prism_sides = 32, meridians = 24, parallels = 11;

/// The file of a mesh, or nothing where there is none.
fs::path find_mesh(const std::string& uri, const fs::path& folder) {
  const auto existing = [](const fs::path& path) {
    std::error_code error;
    return fs::is_regular_file(path, error) ? path : fs::path();
  };
  const std::string package_scheme = "package://", file_scheme = "file://";
  if (uri.compare(0, file_scheme.size(), file_scheme) == 0) return existing(uri.substr(file_scheme.size()));
  if (uri.compare(0, package_scheme.size(), package_scheme) != 0) return existing(folder / uri);
  const std::string inside = uri.substr(package_scheme.size());
  const std::string package = inside.substr(0, inside.find('/'));
  const auto in = [&](const fs::path& place) {
    fs::path found = existing(place / inside);
    if (found.empty() && place.filename() == package) found = existing(place.parent_path() / inside);
    return found;
  };
  if (const char* list = std::getenv("ROS_PACKAGE_PATH")) {
    std::istringstream places(list);
    for (std::string place; std::getline(places, place, ':');)
      if (fs::path found = place.empty() ? fs::path() : in(place); !found.empty()) return found;
  }
  for (fs::path place = folder; !place.empty(); place = place.parent_path()) {
    if (fs::path found = in(place); !found.empty()) return found;
    if (place == place.parent_path()) break;
  }
  return {};
}

void add_ring(double radius, double z, int corners, const Eigen::Isometry3d& pose, Points& points) {
  for (int k = 0; k < corners; ++k) {
    const double angle = 2.0 * pi * k / corners;
    points.push_back(pose * Eigen::Vector3d(radius * std::cos(angle), radius * std::sin(angle), z));
  }
}

class Collision {
 public:
  Collision(const std::string& urdf, int link, const std::string& base, const std::string& tip)
      : urdf_(urdf), chain_(detail::read_chain(read_file(urdf), urdf, base, tip, true)) {
    if (link < 1 || link > static_cast<int>(chain_.joints.size()))
      throw Error(urdf + ": there is no moving link " + std::to_string(link) + " between '" + chain_.base +
                  "' and '" + chain_.tip + "': 1 to " + std::to_string(chain_.joints.size()));
    mover_ = &chain_.joints[static_cast<std::size_t>(link - 1)];
  }

  Shape shape() {
    std::vector<std::pair<const urdf::Collision*, Eigen::Isometry3d>> all;
    for (const detail::UrdfBody& body : mover_->bodies) {
      link_ = body.link->name;
      for (const auto& collision : body.link->collision_array) {
        if (!collision || !collision->geometry) fail("a collision without geometry");
        all.emplace_back(collision.get(), body.pose * detail::to_eigen(collision->origin));
        add_points(*collision->geometry, all.back().second);
      }
    }
    link_ = mover_->link->name;
    if (all.empty()) fail("neither it nor what moves with it has collision geometry");
    try {
      if (all.size() == 1) {
        const auto& [collision, pose] = all.front();
        if (const auto* s = dynamic_cast<const urdf::Sphere*>(collision->geometry.get()))
          return Shape::sphere(pose.translation(), s->radius);
        if (const auto* c = dynamic_cast<const urdf::Cylinder*>(collision->geometry.get())) {
          const Eigen::Vector3d half = 0.5 * c->length * pose.linear().col(2);
          return Shape::cylinder(pose.translation() - half, pose.translation() + half, c->radius);
        }
      }
      return Shape::hull(points_);
    } catch (const Error& error) {
      fail(error.what());
    }
  }

  std::optional<Eigen::AlignedBox3d> box() {
    Eigen::AlignedBox3d box;
    for (const detail::UrdfBody& body : mover_->bodies) {
      link_ = body.link->name;
      for (const auto& collision : body.link->collision_array) {
        if (!collision || !collision->geometry) fail("a collision without geometry");
        extend(box, *collision->geometry, body.pose * detail::to_eigen(collision->origin));
      }
    }
    if (box.isEmpty()) return std::nullopt;
    return box;
  }

 private:
  /// Round geometry reaches farther than the points that stand for it.
  void extend(Eigen::AlignedBox3d& box, const urdf::Geometry& geometry, const Eigen::Isometry3d& pose) {
    points_.clear();
    add_points(geometry, pose);
    for (const Eigen::Vector3d& point : points_) box.extend(point);
    const Eigen::Vector3d centre = pose.translation();
    Eigen::Vector3d reach = Eigen::Vector3d::Zero();
    if (const auto* sphere = dynamic_cast<const urdf::Sphere*>(&geometry)) {
      reach.setConstant(sphere->radius);
    } else if (const auto* cylinder = dynamic_cast<const urdf::Cylinder*>(&geometry)) {
      const Eigen::Array3d axis = pose.linear().col(2).array().abs();
      reach = 0.5 * cylinder->length * axis + cylinder->radius * (1.0 - axis.square()).max(0.0).sqrt();
    } else {
      return;
    }
    box.extend(centre - reach);
    box.extend(centre + reach);
  }

  [[noreturn]] void fail(const std::string& what) const {
    const detail::XmlElement* found = detail::find_named(chain_.elements, "link", link_);
    throw Error(urdf_ + (found != nullptr ? ":" + std::to_string(found->line) : "") + ": link '" + link_ +
                "': " + what);
  }

  void add_points(const urdf::Geometry& geometry, const Eigen::Isometry3d& pose) {
    const auto positive = [&](std::initializer_list<double> sizes) {
      for (const double size : sizes)
        if (!(size > 0.0) || !std::isfinite(size)) fail("collision geometry with a size that is not > 0");
    };
    if (const auto* box = dynamic_cast<const urdf::Box*>(&geometry)) {
      positive({box->dim.x, box->dim.y, box->dim.z});
      for (int corner = 0; corner < 8; ++corner)
        points_.push_back(pose * Eigen::Vector3d((corner & 1 ? 0.5 : -0.5) * box->dim.x,
                                                 (corner & 2 ? 0.5 : -0.5) * box->dim.y,
                                                 (corner & 4 ? 0.5 : -0.5) * box->dim.z));
    } else if (const auto* cylinder = dynamic_cast<const urdf::Cylinder*>(&geometry)) {
      positive({cylinder->radius, cylinder->length});
      for (const double end : {-0.5, 0.5})
        add_ring(cylinder->radius, end * cylinder->length, prism_sides, pose, points_);
    } else if (const auto* sphere = dynamic_cast<const urdf::Sphere*>(&geometry)) {
      positive({sphere->radius});
      for (const double pole : {-1.0, 1.0})
        points_.push_back(pose * Eigen::Vector3d(0, 0, pole * sphere->radius));
      for (int k = 1; k <= parallels; ++k) {
        const double polar = pi * k / (parallels + 1);
        add_ring(sphere->radius * std::sin(polar), sphere->radius * std::cos(polar), meridians, pose,
                 points_);
      }
    } else if (const auto* mesh = dynamic_cast<const urdf::Mesh*>(&geometry)) {
      const fs::path folder = fs::absolute(urdf_).parent_path();
      const fs::path file = find_mesh(mesh->filename, folder);
      if (file.empty()) fail("mesh '" + mesh->filename + "' was not found");
      const Eigen::Vector3d scale(mesh->scale.x, mesh->scale.y, mesh->scale.z);
      for (const Eigen::Vector3d& vertex : detail::mesh_vertices(file.string()))
        points_.push_back(pose * scale.cwiseProduct(vertex));
    } else {
      fail("collision geometry of an unknown kind");
    }
  }

  std::string urdf_, link_;
  detail::UrdfChain chain_;
  const detail::UrdfJoint* mover_ = nullptr;
  Points points_;
};

}  // namespace

Shape Shape::collision(const std::string& urdf, int link, const std::string& base, const std::string& tip) {
  return Collision(urdf, link, base, tip).shape();
}

std::optional<Eigen::AlignedBox3d> collision_box(const std::string& urdf, int link, const std::string& base,
                                                 const std::string& tip) {
  return Collision(urdf, link, base, tip).box();
}

}  // namespace dynid
