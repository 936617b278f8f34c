// SPDX-License-Identifier: Apache-2.0
#include "dynid/retrieval/bounds.hpp"

#include <Eigen/Geometry>
#include <initializer_list>
#include <set>
#include <utility>

#include "base/yaml.hpp"
#include "dynid/base/file.hpp"
#include "dynid/retrieval/shape.hpp"
#include "model/conversions.hpp"

namespace dynid {

namespace {

using detail::YamlItem;

void read_link(const YamlItem& entry, Eigen::Ref<Eigen::VectorXd> lower, Eigen::Ref<Eigen::VectorXd> upper) {
  entry.expect_keys({"mass", "com_x", "com_y", "com_z", "inertia_diagonal", "inertia_off_diagonal"});
  const auto set = [&](const char* key, std::initializer_list<int> indices) {
    const auto [low, high] = entry.at(key).interval();
    for (const int k : indices) {
      lower[k] = low;
      upper[k] = high;
    }
  };
  set("mass", {0});
  set("com_x", {1});
  set("com_y", {2});
  set("com_z", {3});
  set("inertia_diagonal", {4, 6, 9});
  set("inertia_off_diagonal", {5, 7, 8});
  if (lower[0] < 0.0) entry.at("mass").fail("a mass below zero is asked for, eq. (11)");
}

Eigen::Isometry3d read_pose(const YamlItem& entry) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (entry.has("xyz")) pose.translation() = entry.at("xyz").vector<3>();
  if (entry.has("rpy")) pose.linear() = detail::rotation_from_rpy(entry.at("rpy").vector<3>());
  return pose;
}

std::string relative_to(const std::string& folder, const std::string& file) {
  return file.front() == '/' ? file : folder + file;
}

Shape read_solid(const YamlItem& entry, const std::string& folder) {
  const std::string type = entry.at("type").name();
  if (type == "box") {
    entry.expect_keys({"type", "xyz", "rpy", "size"});
    return entry.located([&] { return Shape::box(read_pose(entry), 0.5 * entry.at("size").vector<3>()); });
  }
  if (type == "sphere") {
    entry.expect_keys({"type", "xyz", "radius"});
    return entry.located(
        [&] { return Shape::sphere(read_pose(entry).translation(), entry.at("radius").number()); });
  }
  if (type == "cylinder") {
    entry.expect_keys({"type", "from", "to", "radius"});
    return entry.located([&] {
      return Shape::cylinder(entry.at("from").vector<3>(), entry.at("to").vector<3>(),
                             entry.at("radius").number());
    });
  }
  if (type == "truncated_cone") {
    entry.expect_keys({"type", "from", "to", "radius_from", "radius_to"});
    return entry.located([&] {
      return Shape::truncated_cone(entry.at("from").vector<3>(), entry.at("to").vector<3>(),
                                   entry.at("radius_from").number(), entry.at("radius_to").number());
    });
  }
  if (type == "hull") {
    entry.expect_keys({"type", "points"});
    std::vector<Eigen::Vector3d> points;
    for (const YamlItem& point : entry.at("points").list()) points.push_back(point.vector<3>());
    return entry.located([&] { return Shape::hull(points); });
  }
  if (type == "mesh") {
    entry.expect_keys({"type", "file", "xyz", "rpy", "scale"});
    const std::string file = relative_to(folder, entry.at("file").name());
    const Eigen::Vector3d scale =
        entry.has("scale") ? entry.at("scale").vector<3>() : Eigen::Vector3d::Ones();
    return entry.located([&] { return Shape::mesh(file, read_pose(entry), scale); });
  }
  entry.at("type").fail("unknown shape '" + type +
                        "': box, sphere, cylinder, truncated_cone, hull or mesh is expected");
}

/// `when` is the left side of a guard: the constraint holds where the expression is >= 0.
Constraint conditional(const YamlItem& entry, const Constraint& constraint, int links) {
  if (!entry.has("when")) return constraint;
  const Constraint condition = entry.at("when").located(
      [&] { return make_expression(constraint.name + ", when", entry.at("when").name(), links); });
  Inequality h = condition.alternatives.front().required.front();
  if (condition.exact) h.value = condition.exact;
  return make_conditional(constraint.name, h, constraint, {});
}

Constraint read_constraint(const YamlItem& entry, int links) {
  entry.expect_keys({"name", "expression", "when", "enforce"});
  const std::string name = entry.at("name").name();
  Constraint constraint = entry.at("expression").located([&] {
    return make_expression(name, entry.at("expression").name(), links);
  });
  constraint = conditional(entry, constraint, links);
  if (entry.has("enforce")) constraint.enforced = entry.at("enforce").boolean();
  return constraint;
}

Constraint read_shape(const YamlItem& entry, int links, const std::string& folder) {
  entry.expect_keys({"link", "name", "solids", "urdf", "base", "tip", "when", "enforce"});
  const int link = entry.at("link").integer();
  if (link < 1 || link > links) entry.at("link").fail("there is no such link: 1 to " + std::to_string(links));
  const std::string name = entry.has("name") ? entry.at("name").name()
                                             : "com of link " + std::to_string(link) + " inside its shape";
  std::vector<Constraint> solids;
  if (entry.has("solids") == entry.has("urdf")) entry.fail("either solids or urdf is expected");
  if (entry.has("urdf")) {
    const auto optional = [&](const char* key) { return entry.has(key) ? entry.at(key).name() : ""; };
    solids.push_back(entry.at("urdf").located([&] {
      return Shape::collision(relative_to(folder, entry.at("urdf").name()), link, optional("base"),
                              optional("tip"))
          .contains_com(name, link);
    }));
  } else {
    for (const YamlItem& solid : entry.at("solids").list())
      solids.push_back(read_solid(solid, folder).contains_com(name, link));
    if (solids.empty()) entry.at("solids").fail("no solid is given");
  }
  Constraint constraint = solids.size() == 1 ? solids.front() : any_of(name, solids);
  constraint = conditional(entry, constraint, links);
  if (entry.has("enforce")) constraint.enforced = entry.at("enforce").boolean();
  return constraint;
}

}  // namespace

Bounds read_bounds(const std::string& path) {
  const YamlItem file = YamlItem::document(read_file(path), path, "dynid-bounds-1", "bounds");
  file.expect_keys({"format", "links", "total_mass", "constraints", "shapes"});
  const std::vector<YamlItem> links = file.at("links").list();
  if (links.empty()) file.at("links").fail("no link is bounded");
  const int n = static_cast<int>(links.size());
  Bounds bounds;
  bounds.source = path;
  bounds.lower.resize(10 * n);
  bounds.upper.resize(10 * n);
  for (int i = 0; i < n; ++i)
    read_link(links[static_cast<std::size_t>(i)], bounds.lower.segment(10 * i, 10),
              bounds.upper.segment(10 * i, 10));
  if (file.has("total_mass"))
    std::tie(bounds.total_mass_lower, bounds.total_mass_upper) = file.at("total_mass").interval();
  std::set<std::string> names;
  const auto add = [&](const YamlItem& entry, Constraint constraint) {
    if (!names.insert(constraint.name).second)
      entry.fail("a second constraint is called '" + constraint.name + "'");
    bounds.constraints.push_back(std::move(constraint));
  };
  if (file.has("constraints"))
    for (const YamlItem& entry : file.at("constraints").list()) add(entry, read_constraint(entry, n));
  const std::string folder = path.substr(0, path.find_last_of('/') + 1);
  if (file.has("shapes"))
    for (const YamlItem& entry : file.at("shapes").list()) add(entry, read_shape(entry, n, folder));
  validate(bounds);
  return bounds;
}

}  // namespace dynid
