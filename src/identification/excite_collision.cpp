// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/excite_collision.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <set>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

/// A node, and where it stands.
struct Entry {
  YAML::Node node;
  std::string path;
  const std::string& file;

  [[noreturn]] void fail(const std::string& what) const {
    const YAML::Mark mark = node.Mark();
    throw Error(file + (mark.is_null() ? "" : ":" + std::to_string(mark.line + 1)) + ": " +
                (path.empty() ? "" : path + ": ") + what);
  }
  void expect_keys(std::initializer_list<const char*> known) const {
    if (!node.IsMap()) fail("expected a map");
    std::set<std::string> seen;
    for (const auto& item : node) {
      const Entry key{item.first, path, file};
      const std::string name = item.first.IsScalar() ? item.first.Scalar() : "";
      if (std::find(known.begin(), known.end(), name) == known.end()) key.fail("unknown key '" + name + "'");
      if (!seen.insert(name).second) key.fail("key '" + name + "' appears twice");
    }
  }
  bool has(const char* key) const { return static_cast<bool>(node[key]); }
  Entry at(const char* key) const {
    if (!has(key)) fail(std::string("key '") + key + "' is missing");
    return {node[key], path.empty() ? key : path + "." + key, file};
  }
  std::vector<Entry> list() const {
    if (!node.IsSequence()) fail("expected a list");
    std::vector<Entry> entries;
    for (std::size_t k = 0; k < node.size(); ++k)
      entries.push_back({node[k], path + "[" + std::to_string(k + 1) + "]", file});
    return entries;
  }
  double number() const {
    double value = 0.0;
    if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value))
      fail("expected a finite number");
    return value;
  }
  double length() const {
    const double value = number();
    if (!(value > 0.0)) fail("is not positive");
    return value;
  }
  std::string text() const {
    if (!node.IsScalar() || node.Scalar().empty()) fail("expected a text");
    return node.Scalar();
  }
  Eigen::Vector3d vector() const {
    const std::vector<Entry> entries = list();
    if (entries.size() != 3) fail("expected three numbers");
    return {entries[0].number(), entries[1].number(), entries[2].number()};
  }
};

Capsule read_capsule(const Entry& entry, const Robot& robot) {
  entry.expect_keys({"link", "from", "to", "radius"});
  Capsule capsule;
  capsule.link = entry.at("link").text();
  capsule.frame = -1;
  if (capsule.link == robot.tip_link) capsule.frame = robot.size() + 1;
  for (int i = 0; i < robot.size(); ++i)
    if (capsule.link == robot.joints[static_cast<std::size_t>(i)].link_name) capsule.frame = i + 1;
  if (capsule.link == robot.base_link) capsule.frame = 0;
  if (capsule.frame < 0)
    entry.at("link").fail("robot '" + robot.name + "' has no link '" + capsule.link + "'");
  capsule.from = entry.at("from").vector();
  capsule.to = entry.at("to").vector();
  capsule.radius = entry.at("radius").length();
  return capsule;
}

BoxObstacle read_box(const Entry& entry) {
  entry.expect_keys({"name", "xyz", "rpy", "size"});
  BoxObstacle box;
  box.name = entry.at("name").text();
  if (entry.has("xyz")) box.centre = entry.at("xyz").vector();
  if (entry.has("rpy")) {
    const Eigen::Vector3d rpy = entry.at("rpy").vector();
    box.turn = Eigen::AngleAxisd(rpy[2], Eigen::Vector3d::UnitZ()) *
               Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
               Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX());
  }
  box.size = entry.at("size").vector();
  if (!(box.size.minCoeff() > 0.0)) entry.at("size").fail("is not positive");
  return box;
}

}  // namespace

CollisionModel parse_collision(const std::string& text, const std::string& name, const Robot& robot) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw Error(name + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg);
  }
  const Entry top{root, "", name};
  top.expect_keys({"format", "clearance", "floor", "capsules", "boxes", "ignore"});
  if (top.at("format").text() != "dynid-collision-1") top.at("format").fail("expected dynid-collision-1");
  CollisionModel model;
  model.source = name;
  if (top.has("clearance")) {
    model.clearance = top.at("clearance").number();
    if (model.clearance < 0.0) top.at("clearance").fail("is negative");
  }
  if (top.has("floor")) model.floor = top.at("floor").number();
  std::set<std::string> names = {"floor"};
  for (const Entry& entry : top.at("capsules").list()) {
    model.capsules.push_back(read_capsule(entry, robot));
    names.insert(model.capsules.back().link);
  }
  if (model.capsules.empty()) top.at("capsules").fail("is empty");
  if (top.has("boxes"))
    for (const Entry& entry : top.at("boxes").list()) {
      model.boxes.push_back(read_box(entry));
      if (!names.insert(model.boxes.back().name).second)
        entry.at("name").fail("'" + model.boxes.back().name + "' is the name of something else too");
    }
  if (top.has("ignore"))
    for (const Entry& entry : top.at("ignore").list()) {
      const std::vector<Entry> pair = entry.list();
      if (pair.size() != 2) entry.fail("expected two names");
      for (const Entry& one : pair)
        if (names.count(one.text()) == 0)
          one.fail("'" + one.text() + "' is no capsule's link, no box and not floor");
      model.ignore.emplace_back(pair[0].text(), pair[1].text());
    }
  return model;
}

CollisionModel read_collision(const std::string& path, const Robot& robot) {
  return parse_collision(read_file(path), path, robot);
}

}  // namespace dynid
