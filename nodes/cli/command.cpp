// SPDX-License-Identifier: Apache-2.0
#include "cli/command.hpp"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <iostream>

#include "cli/interrupt.hpp"
#include "cli/log_reader.hpp"
#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/model/model_warning.hpp"
#ifdef DYNID_WITH_ROSBAG
#include "ros/bag.hpp"
#endif

namespace dynid {
namespace {

std::vector<std::string> joint_names(const Robot& robot) {
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  return names;
}

LogReader& log_reader() {
  static LogReader reader;
  return reader;
}

#ifndef DYNID_WITH_ROSBAG
enum class BagCompression { none, bz2, lz4 };

[[noreturn]] void no_bags(const std::string& path) {
  throw Error(path + ": this dynid was built without rosbag: it reads and writes no bags");
}
Log read_bag(const std::string& path, const std::vector<std::string>&, const std::string&, const LogColumns&,
             std::string*) {
  no_bags(path);
}
Log read_servo_bag(const std::string& path, const std::vector<std::string>&, const std::string&,
                   const std::string&, const LogColumns&, std::string*) {
  no_bags(path);
}
void write_bag(const std::string& path, const Log&, const std::vector<std::string>&, const std::string&,
               BagCompression) {
  no_bags(path);
}
#endif

}  // namespace

void Output::add_to(CLI::App& command) {
  command.add_option("--json", json, "Write the result as JSON to FILE, - for standard output")
      ->type_name("FILE");
  command.add_flag("--quiet", quiet, "No summary and no progress");
}

void Output::check(const std::vector<std::string>& files) const {
  if (!json.empty() && json != "-") check_writable(json);
  for (const std::string& file : files)
    if (!file.empty()) check_writable(file);
}

void Output::write(const nlohmann::json& result) const {
  if (json.empty()) return;
  const std::string text = result.dump(2) + "\n";
  if (json == "-") {
    std::cout << text;
  } else {
    write_file(json, text);
  }
}

void RobotOption::add_to(CLI::App& command, const std::string& name, bool required) {
  CLI::Option* option = command.add_option(name, path, "URDF, MJCF or YAML model")->type_name("FILE");
  if (required) option->required();
  command.add_option("--base", base, "Base link, where a URDF branches")->type_name("LINK");
  command.add_option("--tip", tip, "Tip link, where a URDF branches")->type_name("LINK");
  command.add_option("--gravity", gravity, "How the arm is mounted: gravity in the base frame [m/s^2]")
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,Z");
  command.add_flag("--allow-inconsistent", allow_inconsistent,
                   "Warn of links that no body could have (eqs. (11), (16)) instead of refusing them");
}

ModelFile RobotOption::read(const Output& output) const {
  std::vector<Inconsistency> broken;
  ModelFile model =
      read_model_file(path, base, tip, allow_inconsistent ? Consistency::warn : Consistency::refuse, &broken);
  if (!output.quiet)
    for (const Inconsistency& rule : broken)
      std::cerr << "dynid: warning: " << path << ": link '" << rule.link << "' (joint " << rule.joint
                << "): " << rule.rule << ", margin " << rule.margin << "\n";
  if (!gravity.empty()) model.robot.gravity = Eigen::Map<const Eigen::Vector3d>(gravity.data());
  if (!output.quiet && !allow_inconsistent)
    for (const ModelWarning& warning : check_model(model.robot))
      std::cerr << "dynid: warning: " << path << ": " << warning.text << "\n";
  return model;
}

void LogOption::add_to(CLI::App& command, bool written) {
  command.add_option("--topic", topic, "Topic of the sensor_msgs/JointState in logs that are rosbags (.bag)")
      ->type_name("TOPIC")
      ->capture_default_str();
  if (!written) {
    command
        .add_option("--command-topic", command_topic,
                    "Topic of the commanded positions in a rosbag, which makes it a servo log: JointState, "
                    "JointTrajectory or Float64MultiArray")
        ->type_name("TOPIC");
    command
        .add_option("--columns", columns,
                    "Names of a CSV log's columns that are not understood by themselves, # for the joint's "
                    "number or name: q=pos_#,dq=vel_#,tau=trq_#")
        ->type_name("ROLE=PATTERN,...");
    command.add_option("--rate", rate, "Sampling rate of a CSV log without time [Hz]")
        ->check(CLI::PositiveNumber);
    return;
  }
  command.add_option("--compression", compression, "Of a rosbag written")
      ->check(CLI::IsMember({"none", "bz2", "lz4"}))
      ->type_name("none|bz2|lz4")
      ->capture_default_str();
}

void set_log_reader(LogReader reader) { log_reader() = std::move(reader); }

Log LogOption::read(const std::string& path, const Robot& robot, const LogColumns& required) const {
  LogOptions options;
  options.joints = robot.size();
  options.joint_names = joint_names(robot);
  if (!columns.empty()) options.columns = parse_columns(columns);
  options.rate = rate;
  options.required = required;
  if (log_reader())
    if (std::optional<Log> log = log_reader()(path, options, topic)) return *std::move(log);
  if (!is_bag(path)) return read_log(path, options);
  std::string warning;
  Log log = command_topic.empty()
                ? read_bag(path, joint_names(robot), topic, required, &warning)
                : read_servo_bag(path, joint_names(robot), topic, command_topic, required, &warning);
  if (!warning.empty()) std::cerr << "dynid: warning: " << warning << "\n";
  return log;
}

void LogOption::write(const std::string& path, const Log& log, const Robot& robot) const {
  if (!is_bag(path)) return write_log(path, log);
  write_bag(path, log, joint_names(robot), topic,
            compression == "bz2"   ? BagCompression::bz2
            : compression == "lz4" ? BagCompression::lz4
                                   : BagCompression::none);
}

bool is_bag(const std::string& path) { return std::filesystem::path(path).extension() == ".bag"; }

Progress::Progress(const Output& output) {
  if (output.quiet || isatty(STDERR_FILENO) == 0) return;
  writer_ = std::thread([this, watch = Stopwatch()] {
    bool shown = false;
    std::unique_lock<std::mutex> lock(mutex_);
    while (!ended_.wait_for(lock, std::chrono::milliseconds(250), [this] { return end_; })) {
      if (watch.seconds() < 1.0) continue;
      shown = true;
      std::cerr << "\r\033[K" << stage_;
      if (fraction_ > 0.0) std::cerr << " " << std::lround(100.0 * fraction_) << " %";
      std::cerr << ", " << std::lround(watch.seconds()) << " s" << std::flush;
    }
    if (shown) std::cerr << "\r\033[K" << std::flush;
  });
}

Progress::~Progress() {
  if (!writer_.joinable()) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    end_ = true;
  }
  ended_.notify_all();
  writer_.join();
}

void Progress::operator()(const std::string& stage, double fraction) {
  const std::lock_guard<std::mutex> lock(mutex_);
  stage_ = stage;
  fraction_ = fraction;
}

Context Progress::context() {
  Context context;
  context.progress = [this](const std::string& stage, double fraction) { (*this)(stage, fraction); };
  context.stop = &stop_requested();
  return context;
}

std::vector<Log> read_logs(const LogOption& input, const std::vector<std::string>& paths, const Robot& robot,
                           Progress& progress, const LogColumns& required) {
  std::vector<Log> logs;
  for (const std::string& path : paths) {
    progress.context().report("reading " + path, 0.0);
    logs.push_back(input.read(path, robot, required));
  }
  return logs;
}

}  // namespace dynid
