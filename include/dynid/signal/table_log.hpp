// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynid/signal/log.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {

/// What read_log() makes of a table, wherever that came from: columns by their names, units, holes, stamps,
/// wraps. `not_numbers` and `lines` may be empty: nothing was text, and rows count from 1. Throws Error as
/// read_log() does, `table.source` being the file.
Log log_of(Table table, const LogOptions& options);

}  // namespace dynid
