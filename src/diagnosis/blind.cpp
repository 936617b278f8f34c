// SPDX-License-Identifier: Apache-2.0
#include "dynid/diagnosis/blind.hpp"

#include <tbb/parallel_for.h>

#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>

#include "blind_case.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/model/yaml.hpp"

namespace dynid {
namespace {

constexpr int draws_of_a_case = 8;  // a robot may run away from its motion: then another is drawn

std::string case_name(int index) {
  std::string digits = std::to_string(index);
  return "case_" + std::string(digits.size() < 5 ? 5 - digits.size() : 0, '0') + digits;
}

}  // namespace

std::vector<BlindCase> run_blind(const Robot& nominal, const BlindOptions& options) {
  namespace fs = std::filesystem;
  const fs::path logs = fs::path(options.folder) / "logs", sealed = fs::path(options.folder) / "sealed";
  std::error_code error;
  fs::create_directories(logs, error);
  if (!error) fs::create_directories(sealed, error);
  if (error) throw Error(options.folder + ": cannot be made: " + error.message());
  const auto count = static_cast<std::size_t>(options.cases);
  std::vector<BlindCase> cases(count);
  std::mutex mutex;
  int done = 0;
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t k) {
    if (options.stop != nullptr && *options.stop) return;
    BlindCase& here = cases[k];
    const std::string name = case_name(static_cast<int>(k));
    const fs::path folder = logs / name;
    try {
      std::vector<std::string> withhold, others;
      Robot model;
      int logs_of_case = 0;
      for (int attempt = 0; attempt < draws_of_a_case; ++attempt) {
        try {
          // The draw is forgotten before the diagnosis begins; the label goes to the sealed folder.
          const detail::Stage stage = detail::stage_of(nominal, options, static_cast<int>(k), attempt);
          const detail::Draw draw = detail::draw_case(stage, options, static_cast<int>(k), attempt);
          const detail::Recorded recorded =
              detail::record(stage, detail::kind_of(options, static_cast<int>(k)), draw, folder.string());
          write_file((sealed / (name + ".json")).string(),
                     detail::label_json(stage, draw, recorded, options.diagnose.tolerance).dump(1) + "\n");
          if (stage.family) write_file((folder / "model.yaml").string(), to_yaml({stage.nominal, {}, {}}));
          withhold = draw.withheld;
          others = detail::all_but(stage, draw);
          model = stage.nominal;
          logs_of_case = stage.run.logs;
          here.vendor = stage.vendor;
          if (stage.vendor) here.background = {"link_inertial_error"};
          here.drawn = detail::drawn(stage);
          break;
        } catch (const Error&) {
          if (attempt + 1 == draws_of_a_case) throw;
        }
      }
      DiagnoseOptions diagnose_options = options.diagnose;
      diagnose_options.withhold.insert(diagnose_options.withhold.end(), withhold.begin(), withhold.end());
      diagnose_options.progress = nullptr;
      diagnose_options.replay = false;
      std::vector<Log> pair = {read_log((folder / "log_a.csv").string(), model.size())};
      if (logs_of_case > 1) pair.push_back(read_log((folder / "log_b.csv").string(), model.size()));
      const Diagnosis d = diagnose(model, pair, diagnose_options);
      here.withheld = withhold;
      detail::set_answer(d, here);
      if (!others.empty()) {  // what could have been had, now that the diagnosis is done
        diagnose_options.withhold = others;
        const Diagnosis attained = diagnose(model, pair, diagnose_options);
        here.true_shrink = attained.shrink.fraction;
        for (const FoundEffect& e : attained.effects) here.attainable.push_back(e.effect.name);
      }
    } catch (const std::exception& failure) {
      here.failure = failure.what();
    }
    const std::lock_guard<std::mutex> lock(mutex);
    ++done;
    if (options.progress) options.progress(done, options.cases);
  });
  // Only now are the labels opened.
  for (std::size_t k = 0; k < count; ++k) {
    const std::string path = (sealed / (case_name(static_cast<int>(k)) + ".json")).string();
    if (!fs::exists(path)) continue;
    for (const nlohmann::json& e : nlohmann::json::parse(read_file(path))) {
      cases[k].truth.push_back({e["name"], e["joints"], e["parameters"]});
      cases[k].truth_shares.push_back(e.value("share", 0.0));
      cases[k].within_tolerance = e.value("within_tolerance", false);
    }
  }
  return cases;
}

}  // namespace dynid
