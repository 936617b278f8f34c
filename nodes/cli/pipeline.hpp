// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace dynid {

/// What one log says of a robot: identify, retrieve (with bounds) and diagnose against the model in use, by
/// the very commands of the command line, so that the results are theirs. Files are written to one folder,
/// each whole or not at all.
class Pipeline {
 public:
  /// Options of `dynid identify`, `retrieve`, `diagnose` and `excite` by their names with _ for -, as text
  /// (`true` or `false` for flags), and `diagnose` (true): whether to.
  using Options = std::map<std::string, std::string>;

  /// Names of the options there are.
  static std::vector<std::string> option_names();

  /// `model`: file of the model in use. `folder` is made where it is missing, once there is something to
  /// write. With `summary` the commands print theirs to standard output. Throws Error, also on options out of
  /// range.
  Pipeline(std::string model, std::string folder, Options options, bool summary);

  /// Writes the exciting motion of `dynid excite` to `out`; false where none was found.
  bool excite(const std::string& out) const;

  /// `{"status": 0|1, "log", "files": {...}, "adoptable": file or "", "identification", "retrieval",
  /// "diagnosis"}`, the last two null where they were not asked for; also written to `result.json`. Throws
  /// Error as the commands do; files of the steps before stay.
  nlohmann::json run(const std::string& log) const;

  void make_folder() const;                         ///< throws Error
  std::string path(const std::string& file) const;  ///< in the folder

 private:
  using Words = std::vector<std::string>;
  Words words(const std::string& command, const Words& rest) const;
  bool is_on(const std::string& option, bool usual) const;

  std::string model_, folder_;
  Options options_;
  bool summary_;
};

}  // namespace dynid
