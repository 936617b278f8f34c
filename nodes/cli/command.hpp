// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <condition_variable>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "app/job.hpp"
#include "app/serialise.hpp"
#include "dynid/app/context.hpp"
#include "dynid/app/text.hpp"
#include "dynid/model/coefficient.hpp"
#include "dynid/model/robot_file.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {

/// What every command takes, and how it answers.
struct Output {
  std::string json;    ///< file, `-` for standard output, empty for none
  bool quiet = false;  ///< no summary, no progress

  void add_to(CLI::App& command);
  /// Throws Error when the JSON file, or one of `files`, could not be written: before any work is done.
  void check(const std::vector<std::string>& files = {}) const;
  /// A readable summary is wanted: not with --quiet, nor where standard output carries the JSON.
  bool summary() const { return !quiet && json != "-"; }
  void write(const nlohmann::json& result) const;
};

/// A robot from `--robot` (or `--model`), with `--base`, `--tip` and `--gravity`.
struct RobotOption {
  std::string path, base, tip;
  std::vector<double> gravity;  ///< [m/s^2] in the base frame, three numbers; empty: the file's
  bool allow_inconsistent = false;

  void add_to(CLI::App& command, const std::string& name = "--robot", bool required = true);
  /// Reads it; broken rules of eqs. (11) and (16), when they are allowed, and what check_model() finds are
  /// warned of on standard error.
  ModelFile read(const Output& output) const;
};

/// Logs, as CSV or, where the path ends in `.bag`, as sensor_msgs/JointState in a rosbag: joints by name.
struct LogOption {
  std::string topic = "/joint_states";
  std::string command_topic;         ///< of the commanded positions in a bag; empty: none is read
  std::string columns;               ///< of a CSV log, as parse_columns() reads them
  double rate = 0.0;                 ///< [Hz] of a CSV log without time; 0: none
  std::string compression = "none";  ///< of bags written: none, bz2 or lz4

  /// `--topic`, `--columns` and `--rate` or, where logs are `written`, `--topic` and `--compression`.
  void add_to(CLI::App& command, bool written = false);
  /// Throws as read_log(). A bag that is not whole is read as far as it goes, and said so on standard error.
  Log read(const std::string& path, const Robot& robot, const LogColumns& required = {}) const;
  /// Throws as write_log().
  void write(const std::string& path, const Log& log, const Robot& robot) const;
};

/// The path names a rosbag.
bool is_bag(const std::string& path);

/// A line on the terminal, rewritten, once a command has run for a second; nothing elsewhere. It is a thread
/// of its own that writes it: a stage that says nothing for long still shows its name and the time.
class Progress {
 public:
  explicit Progress(const Output& output);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  /// What is being done, and how much of it, 0..1 (0: not known).
  void operator()(const std::string& stage, double fraction = 0.0);
  /// For a use case: it tells this line, and Ctrl-C stops it. Not to outlive this object.
  Context context();

 private:
  std::mutex mutex_;
  std::condition_variable ended_;
  std::string stage_ = "working";
  double fraction_ = 0.0;
  bool end_ = false;
  std::thread writer_;
};

/// Logs of one command, in their order. Throws as LogOption::read().
std::vector<Log> read_logs(const LogOption& input, const std::vector<std::string>& paths, const Robot& robot,
                           Progress& progress, const LogColumns& required = {});

using detail::Stopwatch;

}  // namespace dynid
