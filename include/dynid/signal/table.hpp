// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace dynid {

/// A CSV file of numbers: a header line that names the columns, then one row of numbers a line.
struct Table {
  std::string source;              ///< file name, for messages
  std::vector<std::string> names;  ///< columns, left to right
  Eigen::MatrixXd values;          ///< rows x columns, column-major
  std::vector<long> lines;         ///< line of the file that each row stands on, from 1
  /// Of a lenient reading: for each column what read_table() would have said of its first text that is no
  /// number
  /// (file, line and column, and that `abc` is not a number); empty where there is none.
  std::vector<std::string> not_numbers;

  /// Column index of `name`, or -1.
  int find(const std::string& name) const noexcept;
  /// The columns `prefix1` to `prefixn`, side by side (rows x n); 0 x 0 when none of them is there.
  /// Throws Error naming the first one missing when some are there or `required` is set.
  Eigen::MatrixXd group(const std::string& prefix, int n, bool required) const;
  /// The largest k such that a column `prefix`, k exists; 0 when there is none.
  int count(const std::string& prefix) const noexcept;
};

struct TableOptions {
  /// Fields that are empty, not finite or no number become NaN, for the caller to judge column by column; a
  /// column named twice keeps both.
  bool lenient = false;
};

/// Reads a CSV file; lines that start with `#` and blank lines are skipped (but a `#` line of names straight
/// above numbers is the header). Fields are separated by commas, semicolons, tabs or blanks, as the header
/// is; a decimal comma, quotes, a byte order mark, CRLF and a separator at the end of a line are understood.
/// Throws Error naming file, line and column: unreadable or empty file, no header, a column named twice, a
/// row with too few or too many fields, text where a number should be, a number that is not finite, no row at
/// all; and, by its first bytes, a file of another kind (ROS bag, SQLite, MCAP, parquet, NumPy, MATLAB, HDF5,
/// zip, gzip, XML, JSON), with what to do.
Table read_table(const std::string& path, const TableOptions& options = {});

/// Writes `values` (rows x names.size()) as CSV, whole or not at all, each number in the shortest form that
/// reads back to the same double. Throws Error.
void write_table(const std::string& path, const std::vector<std::string>& names,
                 const Eigen::MatrixXd& values);

/// `prefix1` to `prefixn`, the column names of a quantity over joints.
std::vector<std::string> column_names(const std::string& prefix, int n);

}  // namespace dynid
