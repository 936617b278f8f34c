// SPDX-License-Identifier: Apache-2.0
#include "dynid/app/fleet.hpp"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/compared.hpp"
#include "app/serialise.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kept_format = "dynid-fleet-member-1";

/// What a kept diagnosis was made of: the logs as they were, by size and time of the last change.
json made_of(const FleetMember& member, const std::string& inputs) {
  json logs = json::array();
  for (const std::string& path : member.logs) {
    std::error_code none;
    const auto size = fs::file_size(path, none);
    const auto changed = fs::last_write_time(path, none).time_since_epoch().count();
    logs.push_back({{"path", path}, {"size", none ? 0 : size}, {"changed", none ? 0 : changed}});
  }
  return {{"inputs", inputs}, {"logs", logs}};
}

/// The diagnoses that were made before, a file each.
class Kept {
 public:
  explicit Kept(const FleetJob& job) : job_(job) {
    if (job.folder.empty()) return;
    std::error_code error;
    fs::create_directories(job.folder, error);
    if (error) throw Error(job.folder + ": " + error.message());
  }

  std::optional<std::string> find(std::size_t k) const {
    if (job_.folder.empty() || !fs::exists(path(k))) return std::nullopt;
    const json kept = json::parse(read_file(path(k)), nullptr, false);
    if (!kept.is_object() || kept.value("format", "") != kept_format ||
        kept.value("of", json()) != made_of(job_.members[k], job_.inputs))
      return std::nullopt;
    return kept.at("result").dump();
  }

  void keep(std::size_t k, const json& result) const {
    if (job_.folder.empty()) return;
    write_file(
        path(k),
        json{{"format", kept_format}, {"of", made_of(job_.members[k], job_.inputs)}, {"result", result}}
            .dump());
  }

 private:
  std::string path(std::size_t k) const {
    return (fs::path(job_.folder) / (std::to_string(k + 1) + ".json")).string();
  }
  const FleetJob& job_;
};

/// The diagnosis of one robot as JSON, or {"error": why there is none}.
json result_of(const FleetJob& job, const FleetMember& member, const std::atomic<bool>* stop) {
  Context quiet;
  quiet.stop = stop;
  try {
    DiagnoseJob one = job.each;
    for (const std::string& path : member.logs) one.logs.push_back(job.read(path));
    json diagnosis = to_json(run(one, quiet));
    diagnosis.erase("seconds");  // the same work gives the same bytes
    return {{"diagnosis", diagnosis}};
  } catch (const Error& error) {
    return {{"error", error.what()}};
  }
}

FleetEntry entry_of(const FleetMember& member, const std::string& text) {
  FleetEntry entry;
  entry.member = member;
  const json result = json::parse(text);
  if (result.contains("error")) {
    entry.error = result.at("error").get<std::string>();
    return entry;
  }
  const json& diagnosis = result.at("diagnosis");
  entry.json = diagnosis.dump();
  entry.diagnosis = detail::compared({member.robot, entry.json});
  const json& tolerance = diagnosis.at("gap").at("tolerance");
  double sum = 0.0;
  Eigen::Index joints = 0;
  for (Eigen::Index j = 0; j < entry.diagnosis.rms.size(); ++j) {
    const json& of_no_account = tolerance.at(static_cast<std::size_t>(j));
    if (!of_no_account.is_number() || !(of_no_account.get<double>() > 0.0)) continue;
    sum += std::pow(entry.diagnosis.rms[j] / of_no_account.get<double>(), 2);
    ++joints;
  }
  entry.gap = joints > 0 ? std::sqrt(sum / double(joints)) : 0.0;
  return entry;
}

std::vector<FleetCause> causes_of(const std::vector<FleetEntry>& entries) {
  std::map<std::pair<std::vector<std::string>, std::string>, FleetCause> by_name;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    if (!entries[k].error.empty()) continue;
    std::vector<std::string> names;
    for (const ComparedEffect& e : entries[k].diagnosis.effects) names.push_back(e.name);
    std::sort(names.begin(), names.end());
    const std::string verdict = names.empty() ? entries[k].diagnosis.verdict : "";
    FleetCause& cause = by_name[{names, verdict}];
    cause.effects = names;
    cause.verdict = verdict;
    cause.entries.push_back(k);
  }
  std::vector<FleetCause> out;
  out.reserve(by_name.size());
  for (auto& [name, cause] : by_name) out.push_back(std::move(cause));
  std::stable_sort(out.begin(), out.end(), [](const FleetCause& a, const FleetCause& b) {
    return a.entries.size() > b.entries.size();
  });
  return out;
}

}  // namespace

bool FleetReport::succeeded() const {
  return std::all_of(entries.begin(), entries.end(), [](const FleetEntry& e) { return e.error.empty(); });
}

void check_options(const FleetJob& job) {
  check_options(job.each);
  if (job.members.empty()) throw OptionError("fleet", "names no robot");
}

FleetReport run(const FleetJob& job, const Context& context) {
  check_options(job);
  context.check();
  const Kept kept(job);
  std::vector<std::string> results(job.members.size());
  std::mutex mutex;
  std::size_t done = 0;
  std::vector<std::size_t> mine;
  for (std::size_t k = static_cast<std::size_t>(job.rank); k < results.size();
       k += static_cast<std::size_t>(job.ranks))
    mine.push_back(k);
  tbb::parallel_for(std::size_t{0}, mine.size(), [&](std::size_t i) {
    const std::size_t k = mine[i];
    context.check();
    if (auto before = kept.find(k)) {
      results[k] = *std::move(before);
    } else {
      // Within a diagnosis no other begins: as many logs are in memory as there are cores.
      const json result =
          tbb::this_task_arena::isolate([&] { return result_of(job, job.members[k], context.stop); });
      if (!result.contains("error")) kept.keep(k, result);
      results[k] = result.dump();
    }
    const std::lock_guard<std::mutex> lock(mutex);
    context.report(job.members[k].robot, double(++done) / double(mine.size()));
  });
  if (job.gather) job.gather(results);
  FleetReport report;
  for (std::size_t k = 0; k < results.size(); ++k)
    report.entries.push_back(entry_of(job.members[k], results[k]));
  std::stable_sort(report.entries.begin(), report.entries.end(),
                   [](const FleetEntry& a, const FleetEntry& b) {
                     if (a.error.empty() != b.error.empty()) return a.error.empty();
                     return a.gap > b.gap;
                   });
  report.causes = causes_of(report.entries);
  return report;
}

}  // namespace dynid
