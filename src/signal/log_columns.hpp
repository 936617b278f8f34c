// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dynid/signal/log.hpp"

namespace dynid::detail {

/// Which columns of a file are which quantity.
struct ColumnMap {
  struct Column {
    int index = -1;       ///< in the file
    double factor = 1.0;  ///< to SI, where the name says a unit
  };
  std::map<std::string, std::vector<Column>> roles;  ///< `t`: the likeliest first; others: base to tip
  std::vector<int> unread;
  bool zero_based = false;
  std::string unit;  ///< of those converted, for a person; empty when none is
};

/// Matches names with quantities, see read_log(). Throws Error `source: ...`.
ColumnMap map_columns(const std::string& source, const std::vector<std::string>& names,
                      const LogOptions& options);

}  // namespace dynid::detail
