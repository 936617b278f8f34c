// SPDX-License-Identifier: Apache-2.0
#include "dynid/retrieval/bounds.hpp"

#include <yaml-cpp/yaml.h>

#include <array>
#include <cmath>
#include <initializer_list>
#include <set>
#include <utility>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/retrieval/shape.hpp"

namespace dynid {

namespace {

/// A node and where it stands, for errors.
class Entry {
 public:
  Entry(const YAML::Node& node, std::string path, const std::string& file)
      : node_(node), path_(std::move(path)), file_(&file) {}

  [[noreturn]] void fail(const std::string& what) const {
    const YAML::Mark mark = node_.Mark();
    const std::string line = mark.is_null() ? "" : ":" + std::to_string(mark.line + 1);
    throw Error(*file_ + line + ": " + (path_.empty() ? "" : path_ + ": ") + what);
  }

  void expect_keys(std::initializer_list<const char*> known) const {
    if (!node_.IsMap()) fail("expected a map");
    std::set<std::string> seen;
    for (const auto& item : node_) {
      const Entry key(item.first, path_, *file_);
      if (!item.first.IsScalar()) key.fail("a key is not a word");
      bool found = false;
      for (const char* name : known) found = found || item.first.Scalar() == name;
      if (!found) key.fail("unknown key '" + item.first.Scalar() + "'");
      if (!seen.insert(item.first.Scalar()).second)
        key.fail("key '" + item.first.Scalar() + "' appears twice");
    }
  }

  bool has(const char* key) const { return node_.IsMap() && node_[key]; }

  Entry at(const char* key) const {
    if (!has(key)) fail(std::string("key '") + key + "' is missing");
    return {node_[key], path_.empty() ? key : path_ + "." + key, *file_};
  }

  std::vector<Entry> list() const {
    if (!node_.IsSequence()) fail("expected a list");
    std::vector<Entry> entries;
    for (std::size_t k = 0; k < node_.size(); ++k)
      entries.emplace_back(node_[k], path_ + "[" + std::to_string(k + 1) + "]", *file_);
    return entries;
  }

  double number() const {
    double value = 0.0;
    if (!node_.IsScalar() || !YAML::convert<double>::decode(node_, value) || !std::isfinite(value))
      fail("expected a finite number");
    return value;
  }

  int integer() const {
    int value = 0;
    if (!node_.IsScalar() || !YAML::convert<int>::decode(node_, value)) fail("expected a whole number");
    return value;
  }

  bool flag() const {
    bool value = false;
    if (!node_.IsScalar() || !YAML::convert<bool>::decode(node_, value)) fail("expected true or false");
    return value;
  }

  std::string text() const {
    if (!node_.IsScalar() || node_.Scalar().empty()) fail("expected a text");
    return node_.Scalar();
  }

  Eigen::Vector3d vector() const {
    const std::vector<Entry> entries = list();
    if (entries.size() != 3) fail("expected three numbers");
    return {entries[0].number(), entries[1].number(), entries[2].number()};
  }

  std::pair<double, double> interval() const {
    const std::vector<Entry> ends = list();
    if (ends.size() != 2) fail("expected [lower, upper]");
    const std::pair<double, double> both{ends[0].number(), ends[1].number()};
    if (both.first > both.second) fail("the bounds cross: the lower one is above the upper one");
    return both;
  }

 private:
  YAML::Node node_;
  std::string path_;
  const std::string* file_;
};

/// Reports an Error of the library at the line of `entry`.
template <typename Make>
auto located(const Entry& entry, Make make) {
  try {
    return make();
  } catch (const Error& error) {
    entry.fail(error.what());
  }
}

void read_link(const Entry& entry, Eigen::Ref<Eigen::VectorXd> lower, Eigen::Ref<Eigen::VectorXd> upper) {
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

Eigen::Isometry3d read_pose(const Entry& entry) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (entry.has("xyz")) pose.translation() = entry.at("xyz").vector();
  if (entry.has("rpy")) {
    const Eigen::Vector3d rpy = entry.at("rpy").vector();
    pose.linear() = (Eigen::AngleAxisd(rpy[2], Eigen::Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX()))
                        .toRotationMatrix();
  }
  return pose;
}

std::string relative_to(const std::string& folder, const std::string& file) {
  return file.front() == '/' ? file : folder + file;
}

Shape read_solid(const Entry& entry, const std::string& folder) {
  const std::string type = entry.at("type").text();
  if (type == "box") {
    entry.expect_keys({"type", "xyz", "rpy", "size"});
    return located(entry, [&] { return Shape::box(read_pose(entry), 0.5 * entry.at("size").vector()); });
  }
  if (type == "sphere") {
    entry.expect_keys({"type", "xyz", "radius"});
    return located(
        entry, [&] { return Shape::sphere(read_pose(entry).translation(), entry.at("radius").number()); });
  }
  if (type == "cylinder") {
    entry.expect_keys({"type", "from", "to", "radius"});
    return located(entry, [&] {
      return Shape::cylinder(entry.at("from").vector(), entry.at("to").vector(), entry.at("radius").number());
    });
  }
  if (type == "truncated_cone") {
    entry.expect_keys({"type", "from", "to", "radius_from", "radius_to"});
    return located(entry, [&] {
      return Shape::truncated_cone(entry.at("from").vector(), entry.at("to").vector(),
                                   entry.at("radius_from").number(), entry.at("radius_to").number());
    });
  }
  if (type == "hull") {
    entry.expect_keys({"type", "points"});
    std::vector<Eigen::Vector3d> points;
    for (const Entry& point : entry.at("points").list()) points.push_back(point.vector());
    return located(entry, [&] { return Shape::hull(points); });
  }
  if (type == "mesh") {
    entry.expect_keys({"type", "file", "xyz", "rpy", "scale"});
    const std::string file = relative_to(folder, entry.at("file").text());
    const Eigen::Vector3d scale = entry.has("scale") ? entry.at("scale").vector() : Eigen::Vector3d::Ones();
    return located(entry, [&] { return Shape::mesh(file, read_pose(entry), scale); });
  }
  entry.at("type").fail("unknown shape '" + type +
                        "': box, sphere, cylinder, truncated_cone, hull or mesh is expected");
}

/// `when` is the left side of a guard: the constraint holds where the expression is >= 0.
Constraint conditional(const Entry& entry, const Constraint& constraint, int links) {
  if (!entry.has("when")) return constraint;
  const Constraint condition = located(entry.at("when"), [&] {
    return make_expression(constraint.name + ", when", entry.at("when").text(), links);
  });
  Inequality h = condition.alternatives.front().required.front();
  if (condition.exact) h.value = condition.exact;
  return make_conditional(constraint.name, h, constraint, {});
}

Constraint read_constraint(const Entry& entry, int links) {
  entry.expect_keys({"name", "expression", "when", "enforce"});
  const std::string name = entry.at("name").text();
  Constraint constraint = located(
      entry.at("expression"), [&] { return make_expression(name, entry.at("expression").text(), links); });
  constraint = conditional(entry, constraint, links);
  if (entry.has("enforce")) constraint.enforced = entry.at("enforce").flag();
  return constraint;
}

Constraint read_shape(const Entry& entry, int links, const std::string& folder) {
  entry.expect_keys({"link", "name", "solids", "urdf", "base", "tip", "when", "enforce"});
  const int link = entry.at("link").integer();
  if (link < 1 || link > links) entry.at("link").fail("there is no such link: 1 to " + std::to_string(links));
  const std::string name = entry.has("name") ? entry.at("name").text()
                                             : "com of link " + std::to_string(link) + " inside its shape";
  std::vector<Constraint> solids;
  if (entry.has("solids") == entry.has("urdf")) entry.fail("either solids or urdf is expected");
  if (entry.has("urdf")) {
    const auto optional = [&](const char* key) { return entry.has(key) ? entry.at(key).text() : ""; };
    solids.push_back(located(entry.at("urdf"), [&] {
      return Shape::collision(relative_to(folder, entry.at("urdf").text()), link, optional("base"),
                              optional("tip"))
          .contains_com(name, link);
    }));
  } else {
    for (const Entry& solid : entry.at("solids").list())
      solids.push_back(read_solid(solid, folder).contains_com(name, link));
    if (solids.empty()) entry.at("solids").fail("no solid is given");
  }
  Constraint constraint = solids.size() == 1 ? solids.front() : any_of(name, solids);
  constraint = conditional(entry, constraint, links);
  if (entry.has("enforce")) constraint.enforced = entry.at("enforce").flag();
  return constraint;
}

}  // namespace

Bounds read_bounds(const std::string& path) {
  const std::string content = read_file(path);
  YAML::Node root;
  try {
    root = YAML::Load(content);
  } catch (const YAML::Exception& error) {
    throw Error(path + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg);
  }
  const Entry file(root, "", path);
  file.expect_keys({"format", "links", "total_mass", "constraints", "shapes"});
  if (file.at("format").text() != "dynid-bounds-1") file.at("format").fail("expected dynid-bounds-1");
  const std::vector<Entry> links = file.at("links").list();
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
  const auto add = [&](const Entry& entry, Constraint constraint) {
    if (!names.insert(constraint.name).second)
      entry.fail("a second constraint is called '" + constraint.name + "'");
    bounds.constraints.push_back(std::move(constraint));
  };
  if (file.has("constraints"))
    for (const Entry& entry : file.at("constraints").list()) add(entry, read_constraint(entry, n));
  const std::string folder = path.substr(0, path.find_last_of('/') + 1);
  if (file.has("shapes"))
    for (const Entry& entry : file.at("shapes").list()) add(entry, read_shape(entry, n, folder));
  validate(bounds);
  return bounds;
}

}  // namespace dynid
