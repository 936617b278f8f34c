// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/robot_file.hpp"

#include "dynid/base/file.hpp"
#include "dynid/model/mjcf.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

bool is_xml(const std::string& text) {
  const std::string byte_order_mark = "\xEF\xBB\xBF";
  const std::size_t start = text.compare(0, 3, byte_order_mark) == 0 ? 3 : 0;
  const auto first = text.find_first_not_of(" \t\r\n", start);
  return first != std::string::npos && text[first] == '<';
}

void check_end(const std::string& asked, const std::string& there, const char* role,
               const std::string& path) {
  if (!asked.empty() && asked != there) {
    throw Error(path + ": unknown " + role + " link '" + asked + "': a model file is one chain, and its " +
                role + " is '" + there + "'");
  }
}

}  // namespace

ModelFile read_model_file(const std::string& path, const std::string& base, const std::string& tip,
                          Consistency consistency, std::vector<Inconsistency>* broken) {
  const std::string text = read_file(path);
  ModelFile model;
  if (is_xml(text) && is_mjcf(text)) {
    model.robot = read_mjcf(path, base, tip, &text).robot;
  } else if (is_xml(text)) {
    model.robot = parse_urdf(text, path, base, tip);
  } else {
    model = parse_model(text, path);
    check_end(base, model.robot.base_link, "base", path);
    check_end(tip, model.robot.tip_link, "tip", path);
  }
  if (broken != nullptr) broken->clear();
  if (consistency == Consistency::ignore) return model;
  const std::vector<Inconsistency> found = inconsistencies(model.robot);
  if (consistency == Consistency::refuse && !found.empty()) {
    const std::size_t others = found.size() - 1;
    throw Error(path + ": " + describe(found.front()) +
                (others == 0 ? "" : " (and " + std::to_string(others) + " more)"));
  }
  if (broken != nullptr) *broken = found;
  return model;
}

Robot read_robot(const std::string& path, const std::string& base, const std::string& tip,
                 Consistency consistency, std::vector<Inconsistency>* broken) {
  return read_model_file(path, base, tip, consistency, broken).robot;
}

}  // namespace dynid
