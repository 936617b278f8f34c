// SPDX-License-Identifier: Apache-2.0
//
// The kernels against their peers on the published Panda: the same random states, one run, repetitions
// interleaved at random, processor time. Every engine is first checked against the others on every state.
//
//   dynid_bench [--json FILE] [any flag of Google Benchmark]
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dynid/model/yaml.hpp"
#include "engines.hpp"

namespace {

/// Prints as Google Benchmark does, and keeps the time of each repetition [ns a state].
class Collector : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration || run.error_occurred) continue;
      const double seconds = run.cpu_accumulated_time / static_cast<double>(run.iterations);
      times_[run.run_name.function_name].push_back(1e9 * seconds / samples);
    }
    if (!runs.empty() && runs.front().run_type == Run::RT_Aggregate) ConsoleReporter::ReportRuns(runs);
  }
  std::map<std::string, std::vector<double>>& times() { return times_; }

 private:
  std::map<std::string, std::vector<double>> times_;
};

struct Statistics {
  double median, mean, deviation, worst;
  explicit Statistics(std::vector<double> x) {
    std::sort(x.begin(), x.end());
    const std::size_t half = x.size() / 2;
    median = x.size() % 2 == 1 ? x[half] : 0.5 * (x[half - 1] + x[half]);
    mean = deviation = 0.0;
    for (const double v : x) mean += v / static_cast<double>(x.size());
    for (const double v : x) deviation += (v - mean) * (v - mean) / static_cast<double>(x.size());
    deviation = std::sqrt(deviation);
    worst = x.back();
  }
};

/// How many times as fast as the peer we mean to be.
struct Goal {
  const char *here, *peer;
  double v3, plain;  // 0: none
};
constexpr Goal goals[] = {
    {"inverse_dynamics/dynid", "inverse_dynamics/pinocchio", 5, 4},
    {"inverse_dynamics/dynid", "inverse_dynamics/kdl", 5, 0},
    {"inverse_dynamics_batched/dynid", "inverse_dynamics/pinocchio", 14, 0},
    {"regressor/dynid", "regressor/pinocchio", 5, 4},
    {"mass_matrix/dynid", "mass_matrix/pinocchio", 3.5, 0},
    {"mass_matrix/dynid", "mass_matrix/kdl", 0, 0},
    {"coriolis_matrix/dynid", "coriolis_matrix/pinocchio", 4, 0},
};

}  // namespace

int main(int argc, char** argv) {
  std::string json_file;
  std::vector<char*> arguments(argv, argv + 1);
  std::string defaults[] = {"--benchmark_repetitions=15", "--benchmark_min_time=0.02",
                            "--benchmark_enable_random_interleaving=true"};
  for (std::string& flag : defaults) arguments.push_back(flag.data());
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--json" && i + 1 < argc)
      json_file = argv[++i];
    else
      arguments.push_back(argv[i]);
  }
  int count = static_cast<int>(arguments.size());
  benchmark::Initialize(&count, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return 2;

  const double difference =
      register_benchmarks(dynid::read_model(std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml").robot);
  std::printf("flags %s; engines agree to %.1e over %d states\n", DYNID_BENCH_FLAGS, difference, samples);
  if (!(difference < 1e-10)) {
    std::fprintf(stderr, "the engines disagree: nothing to compare\n");
    return 1;
  }
  Collector collector;
  benchmark::RunSpecifiedBenchmarks(&collector);

  nlohmann::json report = {{"flags", DYNID_BENCH_FLAGS}, {"states", samples}, {"disagreement", difference}};
  if (pinocchio_version() != nullptr) report["pinocchio"] = pinocchio_version();
  auto& times = collector.times();
  std::printf("\n%-34s %9s %9s %9s %9s\n", "ns a state", "median", "mean", "+-", "worst");
  for (const auto& [name, x] : times) {
    const Statistics s(x);
    std::printf("%-34s %9.1f %9.1f %9.1f %9.1f\n", name.c_str(), s.median, s.mean, s.deviation, s.worst);
    report["ns"][name] = {
        {"median", s.median}, {"mean", s.mean}, {"deviation", s.deviation}, {"worst", s.worst}};
  }
  std::printf("\n%-34s %-28s %9s %9s\n", "times as fast as the peer", "", "median", "goal");
  const bool v3 = std::string(DYNID_BENCH_FLAGS) != "-O3";
  for (const Goal& goal : goals) {
    if (times.count(goal.here) == 0 || times.count(goal.peer) == 0) continue;
    const double ratio = Statistics(times[goal.peer]).median / Statistics(times[goal.here]).median;
    const double wanted = v3 ? goal.v3 : goal.plain;
    char asked[16] = "";
    if (wanted > 0) std::snprintf(asked, sizeof asked, "%g", wanted);
    std::printf("%-34s %-28s %9.2f %9s%s\n", goal.here, goal.peer, ratio, asked,
                wanted > 0 && ratio < wanted ? "  missed" : "");
    nlohmann::json entry = {{"here", goal.here}, {"peer", goal.peer}, {"ratio", ratio}};
    if (wanted > 0) entry["goal"] = wanted;
    report["ratios"].push_back(entry);
  }
  if (!json_file.empty()) {
    std::ofstream out(json_file);
    out << report.dump(2) << "\n";
    if (!out.flush()) {
      std::fprintf(stderr, "%s: cannot be written\n", json_file.c_str());
      return 2;
    }
  }
  return 0;
}
