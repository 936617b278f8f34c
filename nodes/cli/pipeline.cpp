// SPDX-License-Identifier: Apache-2.0
#include "cli/pipeline.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <utility>

#include "cli/run_command.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

struct Option {
  const char* name;
  const char* commands;  // those that take it, by their first letters
  bool flag;
};

constexpr Option table[] = {
    {"base", "ide", false},        {"tip", "ide", false},     {"allow_inconsistent", "ie", true},
    {"topic", "id", false},        {"cutoff", "i", false},    {"friction", "i", false},
    {"rotor_inertia", "ie", true}, {"method", "i", false},    {"motion", "i", false},
    {"prune", "i", false},         {"validate", "i", false},  {"bounds", "r", false},
    {"runs", "r", false},          {"steps", "r", false},     {"agree", "r", false},
    {"weighted", "r", true},       {"prior", "r", false},     {"seed", "rde", false},
    {"threads", "re", false},      {"reference", "d", false}, {"tolerance", "d", false},
    {"withhold", "d", false},      {"harmonics", "e", false}, {"period", "e", false},
    {"base_period", "e", false},   {"rate", "e", false},      {"kind", "e", false},
    {"ramp", "e", false},          {"criterion", "e", false}, {"collision", "e", false},
    {"margin", "e", false},        {"starts", "e", false},    {"effort", "e", false},
};

nlohmann::json read_json(const std::string& path) { return nlohmann::json::parse(read_file(path)); }

}  // namespace

std::vector<std::string> Pipeline::option_names() {
  std::vector<std::string> names = {"diagnose"};
  for (const Option& option : table) names.push_back(option.name);
  return names;
}

Pipeline::Pipeline(std::string model, std::string folder, Options options, bool summary)
    : model_(std::move(model)), folder_(std::move(folder)), options_(std::move(options)), summary_(summary) {
  for (const auto& [name, value] : options_) {
    const std::vector<std::string> known = option_names();
    if (std::find(known.begin(), known.end(), name) == known.end()) throw Error(name + " is not an option");
  }
  is_on("diagnose", true);
  check_command(words("identify", {"--log=log"}));
  check_command(words("diagnose", {"--log=log"}));
  check_command(words("excite", {"--out=motion"}));
  if (options_.count("bounds") > 0) check_command(words("retrieve", {}));
}

void Pipeline::make_folder() const {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) throw Error(folder_ + ": cannot be made: " + error.message());
  check_writable(path("result.json"));
}

std::string Pipeline::path(const std::string& file) const {
  return (std::filesystem::path(folder_) / file).string();
}

bool Pipeline::is_on(const std::string& option, bool usual) const {
  const auto found = options_.find(option);
  if (found == options_.end()) return usual;
  if (found->second == "true" || found->second == "1") return true;
  if (found->second == "false" || found->second == "0") return false;
  throw Error(option + ": " + found->second + " is not true or false");
}

Pipeline::Words Pipeline::words(const std::string& command, const Words& rest) const {
  Words words = {command};
  if (command == "diagnose") words.push_back("--model=" + model_);
  if (command == "identify" || command == "excite") words.push_back("--robot=" + model_);
  for (const Option& option : table) {
    const auto found = options_.find(option.name);
    if (std::strchr(option.commands, command.front()) == nullptr || found == options_.end()) continue;
    std::string name = std::string("--") + option.name;
    std::replace(name.begin(), name.end(), '_', '-');
    if (!option.flag) {
      words.push_back(name + "=" + found->second);
    } else if (is_on(option.name, false)) {
      words.push_back(name);
    }
  }
  if (!summary_) words.emplace_back("--quiet");
  words.insert(words.end(), rest.begin(), rest.end());
  return words;
}

bool Pipeline::excite(const std::string& out) const {
  make_folder();
  return run_command(words("excite", {"--out=" + out})) == 0;
}

nlohmann::json Pipeline::run(const std::string& log) const {
  if (!std::filesystem::exists(log)) throw Error(log + ": there is no such file");
  make_folder();
  const std::string identified = path("identified.yaml"), identification = path("identification.json");
  nlohmann::json result = {{"status", 0},
                           {"log", log},
                           {"files", {{"model", identified}, {"identification", identification}}},
                           {"retrieval", nullptr},
                           {"diagnosis", nullptr}};
  nlohmann::json& files = result["files"];
  int status =
      run_command(words("identify", {"--log=" + log, "--out=" + identified, "--json=" + identification}));
  result["identification"] = read_json(identification);
  result["adoptable"] = identified;

  if (options_.count("bounds") > 0) {
    const std::string feasible = path("feasible.yaml"), retrieval = path("retrieval.json");
    status = std::max(status, run_command(words("retrieve", {"--model=" + identified, "--out=" + feasible,
                                                             "--json=" + retrieval})));
    files["retrieval"] = retrieval;
    result["retrieval"] = read_json(retrieval);
    if (result["retrieval"]["feasible"]) result["adoptable"] = files["feasible"] = feasible;
  }
  if (is_on("diagnose", true)) {
    const std::string diagnosis = path("diagnosis.json"), report = path("report.html"),
                      patched = path("patched.yaml");
    status = std::max(status, run_command(words("diagnose", {"--log=" + log, "--json=" + diagnosis,
                                                             "--report=" + report, "--patch=" + patched})));
    files["diagnosis"] = diagnosis;
    files["report"] = report;
    result["diagnosis"] = read_json(diagnosis);
    if (!result["diagnosis"]["effects"].empty()) files["patched"] = patched;
    if (result["diagnosis"]["verdict"] == "data_invalid") status = 1;
  }
  result["status"] = status;
  write_file(path("result.json"), result.dump(2) + "\n");
  return result;
}

}  // namespace dynid
