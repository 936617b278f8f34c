// SPDX-License-Identifier: Apache-2.0
#include <csv.h>

#include <filesystem>
#include <memory>
#include <set>
#include <sstream>

#include "dynid/app/fleet.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

/// The separator of a line of names: the first of these that is in it.
char separator_of(const std::string& header) {
  for (const char c : {'\t', ';', ','})
    if (header.find(c) != std::string::npos) return c;
  return ',';
}

/// Fields of one line, quotes taken off.
std::vector<std::string> fields_of(const std::string& line, char separator) {
  csv_parser parser;
  if (csv_init(&parser, CSV_APPEND_NULL) != 0) throw Error("libcsv could not be started");
  const std::unique_ptr<csv_parser, void (*)(csv_parser*)> end(&parser, csv_free);
  csv_set_delim(&parser, static_cast<unsigned char>(separator));
  std::vector<std::string> out;
  const auto take = [](void* text, std::size_t size, void* to) {
    static_cast<std::vector<std::string>*>(to)->emplace_back(static_cast<const char*>(text), size);
  };
  csv_parse(&parser, line.data(), line.size(), take, nullptr, &out);
  csv_fini(&parser, take, nullptr, &out);
  return out;
}

void check_header(const std::vector<std::string>& names, const std::string& place) {
  std::set<std::string> seen;
  for (const std::string& name : names) {
    const bool log =
        name.rfind("log", 0) == 0 && name.find_first_not_of("0123456789", 3) == std::string::npos;
    if (name != "robot" && !log)
      throw Error(place + "column '" + name + "': expected robot, log, log2, log3...");
    if (!seen.insert(name).second) throw Error(place + "the header names column " + name + " twice");
  }
  if (seen.count("robot") == 0 || seen.size() < 2)
    throw Error(place + "the header has to name the columns robot and log");
}

}  // namespace

std::vector<FleetMember> read_fleet(const std::string& path) {
  std::string text = read_file(path);
  if (text.rfind("\xef\xbb\xbf", 0) == 0) text.erase(0, 3);  // byte order mark
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::vector<FleetMember> out;
  std::vector<std::string> names;
  std::set<std::string> robots;
  char separator = ',';
  std::istringstream lines(text);
  std::size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.find_first_not_of(" \t") == std::string::npos || line[0] == '#') continue;
    const std::string place = path + ":" + std::to_string(number) + ": ";
    if (names.empty()) {
      separator = separator_of(line);
      names = fields_of(line, separator);
      check_header(names, place);
      continue;
    }
    const std::vector<std::string> fields = fields_of(line, separator);
    if (fields.size() > names.size())
      throw Error(place + "the row has " + std::to_string(fields.size()) + " fields, the header names " +
                  std::to_string(names.size()));
    FleetMember member;
    for (std::size_t k = 0; k < fields.size(); ++k) {
      if (fields[k].empty()) continue;
      if (names[k] == "robot")
        member.robot = fields[k];
      else
        member.logs.push_back((folder / fields[k]).lexically_normal().string());
    }
    if (member.robot.empty()) throw Error(place + "the row names no robot");
    if (member.logs.empty()) throw Error(place + "robot " + member.robot + " has no log");
    if (!robots.insert(member.robot).second) throw Error(place + "robot " + member.robot + " is there twice");
    out.push_back(std::move(member));
  }
  if (out.empty()) throw Error(path + ": no robot: a header robot,log and a row a robot are expected");
  return out;
}

}  // namespace dynid
