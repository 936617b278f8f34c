// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

namespace dynid {

/// Something that reading a log found, and what was done about it.
struct LogNote {
  std::string name;  ///< incomplete_rows, time_unit, header_unit, wrapped_position, zero_based, made_time
  std::vector<int> joints;  ///< from 1; empty when it concerns the whole log
  double value = 0.0;
  std::string unit;
  std::string text;  ///< one sentence
};

/// What a robot recorded: N samples of n joints, base to tip. A quantity that was not recorded has no rows.
struct Log {
  std::string source;       ///< file, for messages
  Eigen::VectorXd t;        ///< [s] N, strictly increasing but for repeats; empty for samples without time
  Eigen::MatrixXd q;        ///< N x n, joint position [rad or m]
  Eigen::MatrixXd dq;       ///< N x n, joint velocity [rad/s or m/s]
  Eigen::MatrixXd tau;      ///< N x n, joint torque [N m or N]
  Eigen::MatrixXd ddq;      ///< N x n, joint acceleration [rad/s^2], optional
  Eigen::MatrixXd tau_cmd;  ///< N x n, commanded torque [N m], optional
  Eigen::MatrixXd theta;    ///< N x n, motor-side position [rad], optional
  Eigen::MatrixXd temp;     ///< N x n, temperature [deg C], optional
  Eigen::MatrixXd u;        ///< N x n, commanded position [rad or m], optional
  Eigen::MatrixXd i;        ///< N x n, motor current [A], optional
  /// What was read as what: the names above (`t`, `q`, ...) and the file's columns, base to tip.
  std::map<std::string, std::vector<std::string>> columns;
  std::vector<std::string> unread;  ///< columns that were not read
  std::vector<LogNote> notes;       ///< what a person should know about the reading

  Eigen::Index samples() const noexcept { return q.rows(); }          ///< N
  int joints() const noexcept { return static_cast<int>(q.cols()); }  ///< n
};

/// Which columns a log must have; the others are read where they stand.
struct LogColumns {
  bool t = true;
  bool dq = true;
  bool tau = true;
};

/// How to read a log.
struct LogOptions {
  int joints = 0;                        ///< n; 0: as many as there are names, or as the file has
  std::vector<std::string> joint_names;  ///< of the robot, base to tip; may be empty
  /// Role (`t`, `q`, `dq`, `tau`, `ddq`, `u`, `i`, `tau_cmd`, `theta`, `temp`) and the name of its columns,
  /// `#` or `{}` standing for the joint's number (from 1, or from 0 where there is a 0) or, with joint_names,
  /// its name.
  std::map<std::string, std::string> columns;
  double rate = 0.0;  ///< [Hz], for a log without time; 0: none
  LogColumns required;
  /// Positions that jump by a whole turn are put together again.
  bool unwrap = true;
};

/// Reads `ROLE=PATTERN,...`, as `--columns` takes it, into LogOptions::columns. Throws Error naming the role.
std::map<std::string, std::string> parse_columns(const std::string& text);

/// Reads a CSV log in any of the dialects that read_table() understands. Columns in any order, upper or lower
/// case: `t, q1.., dq1.., tau1..`, optional `ddq, u, i, tau_cmd, theta, temp`; also `q_1`, `q[1]`, counted
/// from 0 (where there is a `q0`), `qd1`, `effort1`, `<joint name>_pos|_vel|_eff`, what PlotJuggler,
/// `rostopic echo -p` and the recorder of Universal Robots' RTDE write, and LogOptions::columns for the rest.
/// A unit in brackets behind a name (`q1 [deg]`, `t (ms)`) is converted. Rows with a number missing are left
/// out; stamps in ms, us or ns are converted; both are said in Log::notes.
///
/// Throws Error naming file, line and column for what read_table() refuses, a missing column, text in a
/// column that is read, two columns for one quantity, another number of joints than the robot's, more than a
/// tenth of the rows incomplete, and time that goes back.
Log read_log(const std::string& path, const LogOptions& options);

/// The same with `joints` (0: as the file has) and `required` alone.
Log read_log(const std::string& path, int joints = 0, const LogColumns& required = {});

/// Writes what the log has as CSV, in the order `t, q.., dq.., tau.., ddq.., tau_cmd.., theta.., temp.., u..,
/// i..`, whole or not at all, every number reading back to the same double. Throws Error naming the path,
/// also on sizes that do not match.
void write_log(const std::string& path, const Log& log);

}  // namespace dynid
