// SPDX-License-Identifier: Apache-2.0
#include "dynid/identification/excite_collision.hpp"

#include <Eigen/Geometry>
#include <set>

#include "base/yaml.hpp"
#include "dynid/base/file.hpp"
#include "model/conversions.hpp"

namespace dynid {
namespace {

using detail::YamlItem;

Capsule read_capsule(const YamlItem& entry, const Robot& robot) {
  entry.expect_keys({"link", "from", "to", "radius"});
  Capsule capsule;
  capsule.link = entry.at("link").name();
  capsule.frame = -1;
  if (capsule.link == robot.tip_link) capsule.frame = robot.size() + 1;
  for (int i = 0; i < robot.size(); ++i)
    if (capsule.link == robot.joints[static_cast<std::size_t>(i)].link_name) capsule.frame = i + 1;
  if (capsule.link == robot.base_link) capsule.frame = 0;
  if (capsule.frame < 0)
    entry.at("link").fail("robot '" + robot.name + "' has no link '" + capsule.link + "'");
  capsule.from = entry.at("from").vector<3>();
  capsule.to = entry.at("to").vector<3>();
  capsule.radius = entry.at("radius").positive_number();
  return capsule;
}

BoxObstacle read_box(const YamlItem& entry) {
  entry.expect_keys({"name", "xyz", "rpy", "size"});
  BoxObstacle box;
  box.name = entry.at("name").name();
  if (entry.has("xyz")) box.centre = entry.at("xyz").vector<3>();
  if (entry.has("rpy")) box.turn = detail::rotation_from_rpy(entry.at("rpy").vector<3>());
  box.size = entry.at("size").vector<3>();
  if (!(box.size.minCoeff() > 0.0)) entry.at("size").fail("is not positive");
  return box;
}

}  // namespace

CollisionModel parse_collision(const std::string& text, const std::string& name, const Robot& robot) {
  const YamlItem top = YamlItem::document(text, name, "dynid-collision-1", "a collision model");
  top.expect_keys({"format", "clearance", "floor", "capsules", "boxes", "ignore"});
  CollisionModel model;
  model.source = name;
  if (top.has("clearance")) {
    model.clearance = top.at("clearance").number();
    if (model.clearance < 0.0) top.at("clearance").fail("is negative");
  }
  if (top.has("floor")) model.floor = top.at("floor").number();
  std::set<std::string> names = {"floor"};
  for (const YamlItem& entry : top.at("capsules").list()) {
    model.capsules.push_back(read_capsule(entry, robot));
    names.insert(model.capsules.back().link);
  }
  if (model.capsules.empty()) top.at("capsules").fail("is empty");
  if (top.has("boxes"))
    for (const YamlItem& entry : top.at("boxes").list()) {
      model.boxes.push_back(read_box(entry));
      if (!names.insert(model.boxes.back().name).second)
        entry.at("name").fail("'" + model.boxes.back().name + "' is the name of something else too");
    }
  if (top.has("ignore"))
    for (const YamlItem& entry : top.at("ignore").list()) {
      const std::vector<YamlItem> pair = entry.list();
      if (pair.size() != 2) entry.fail("expected two names");
      for (const YamlItem& one : pair)
        if (names.count(one.name()) == 0)
          one.fail("'" + one.name() + "' is no capsule's link, no box and not floor");
      model.ignore.emplace_back(pair[0].name(), pair[1].name());
    }
  return model;
}

CollisionModel read_collision(const std::string& path, const Robot& robot) {
  return parse_collision(read_file(path), path, robot);
}

}  // namespace dynid
