// SPDX-License-Identifier: Apache-2.0
#include "dynid/signal/log.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "dynid/base/error.hpp"
#include "dynid/signal/table.hpp"
#include "dynid/signal/table_log.hpp"
#include "log_columns.hpp"

namespace dynid {
namespace {

constexpr double turn = 6.283185307179586;
constexpr double part_incomplete =
    0.1;                           // of the rows: more is no log with holes, but one that was not understood
constexpr double near_turn = 0.1;  // of a turn: a jump this near to one is a wrap
constexpr double longest_step = 50.0;  // of stamps taken for seconds: no joint is logged once a minute
constexpr double largest_rad = 20.0;   // beyond it, positions are in degrees, and a turn is 360

struct TimeUnit {
  const char* name;
  double factor;  ///< [s]
  double epoch;   ///< stamps since 1970 are larger
};
constexpr TimeUnit time_units[] = {{"ns", 1e-9, 1e17}, {"us", 1e-6, 1e14}, {"ms", 1e-3, 1e11}};

/// 1, 2 and 3
std::string named(const std::vector<int>& joints) {
  std::string text;
  for (std::size_t i = 0; i < joints.size(); ++i)
    text += (i == 0 ? "" : i + 1 == joints.size() ? " and " : ", ") + std::to_string(joints[i]);
  return text;
}

double median_step(const Eigen::VectorXd& t) {
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < t.size(); ++i)
    if (t[i] > t[i - 1]) steps.push_back(t[i] - t[i - 1]);
  if (steps.empty()) return 0.0;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  return steps[steps.size() / 2];
}

/// Way by the positions over way by velocity and stamps: 1 where the stamps are in seconds.
double way_ratio(const Log& log) {
  double positions = 0.0, velocities = 0.0;
  for (Eigen::Index i = 1; i < log.samples(); ++i) {
    const double dt = log.t[i] - log.t[i - 1];
    positions += (log.q.row(i) - log.q.row(i - 1)).cwiseAbs().sum();
    velocities += dt * 0.5 * (log.dq.row(i) + log.dq.row(i - 1)).cwiseAbs().sum();
  }
  return velocities > 0.0 ? positions / velocities : 1.0;
}

/// Stamps that are not in seconds are made so, and said.
void find_time_unit(Log& log) {
  if (log.t.size() < 3) return;
  const double step = median_step(log.t);
  const TimeUnit* unit = nullptr;
  for (const TimeUnit& u : time_units)
    if (unit == nullptr && log.t[0] > u.epoch) unit = &u;
  if (unit == nullptr && step > 1e5) unit = &time_units[0];
  if (unit == nullptr && step > longest_step) unit = &time_units[1];
  if (unit == nullptr && step >= 0.5 && log.dq.size() > 0) {
    const double ratio = way_ratio(log);
    if (ratio > 0.5e-3 && ratio < 2e-3) unit = &time_units[2];
  }
  if (unit == nullptr) return;
  // From the first one on: a double has too few digits for nanoseconds since 1970.
  log.t = (log.t.array() - log.t[0]) * unit->factor;
  log.notes.push_back(
      {"time_unit",
       {},
       unit->factor,
       "s",
       "stamps look like " + std::string(unit->name) + ": read as such, counted from the first"});
}

/// Positions that jump by a turn, put together again.
void unwrap(Log& log) {
  std::vector<int> joints;
  double wraps = 0.0;
  for (int j = 0; j < log.joints(); ++j) {
    auto q = log.q.col(j);
    const double whole = q.cwiseAbs().maxCoeff() > largest_rad ? 360.0 : turn;
    if (q.maxCoeff() - q.minCoeff() < (1.0 - near_turn) * whole) continue;
    double shift = 0.0;
    bool found = false;
    double before = q[0];
    for (Eigen::Index i = 1; i < q.size(); ++i) {
      const double step = q[i] - before;
      before = q[i];
      if (std::abs(std::abs(step) - whole) < near_turn * whole) {
        shift -= std::copysign(whole, step);
        found = true;
        wraps += 1.0;
      }
      q[i] += shift;
    }
    if (found) joints.push_back(j + 1);
  }
  if (!joints.empty())
    log.notes.push_back(
        {"wrapped_position", joints, wraps, "1",
         "the position of joint " + named(joints) + " wraps at half a turn: put together again"});
}

}  // namespace

std::map<std::string, std::string> parse_columns(const std::string& text) {
  std::map<std::string, std::string> columns;
  std::istringstream parts(text);
  std::string part;
  while (std::getline(parts, part, ',')) {
    const auto equals = part.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == part.size())
      throw Error("--columns: '" + part +
                  "': ROLE=PATTERN,... is expected, such as q=pos_#,dq=vel_#,tau=trq_#");
    if (!columns.insert({part.substr(0, equals), part.substr(equals + 1)}).second)
      throw Error("--columns: " + part.substr(0, equals) + ": given twice");
  }
  return columns;
}

Log read_log(const std::string& path, const LogOptions& options) {
  return log_of(read_table(path, {true}), options);
}

Log log_of(Table table, const LogOptions& options) {
  const std::string path = table.source;
  if (table.not_numbers.empty()) table.not_numbers.resize(table.names.size());
  if (table.lines.empty()) {
    table.lines.resize(static_cast<std::size_t>(table.values.rows()));
    std::iota(table.lines.begin(), table.lines.end(), 1L);
  }
  const detail::ColumnMap map = detail::map_columns(path, table.names, options);
  Log log;
  log.source = path;
  const auto has = [&](const char* role) { return map.roles.count(role) > 0; };
  if (options.required.dq && !has("dq")) throw Error(path + ": column dq1 is missing");
  if (options.required.tau && !has("tau")) {
    std::string text = path + ": column tau1 is missing";
    if (has("i")) {
      const std::string& current = table.names[static_cast<std::size_t>(map.roles.at("i").front().index)];
      text +=
          " (there are motor currents, " + current +
          "..: read them as torques with --columns tau=PATTERN and --assume torque_is_current=FACTOR,...)";
    }
    throw Error(text);
  }
  if (!has("t") && options.required.t && !(options.rate > 0.0))
    throw Error(path + ": column t is missing (give --rate HZ for a log without time)");

  // The first stamps that move on.
  detail::ColumnMap::Column time;
  if (has("t")) {
    time = map.roles.at("t").front();
    for (const auto& column : map.roles.at("t")) {
      const auto values = table.values.col(column.index).array();
      if (!table.not_numbers[static_cast<std::size_t>(column.index)].empty()) continue;
      if ((values == values[0]).all()) continue;
      time = column;
      break;
    }
  }

  // Rows with a hole are left out; so are roles that are not needed and mostly holes.
  Eigen::Array<bool, Eigen::Dynamic, 1> whole =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(table.values.rows(), true);
  const auto check = [&](int column) {
    if (const std::string& text = table.not_numbers[static_cast<std::size_t>(column)]; !text.empty())
      throw Error(text);
    whole = whole && table.values.col(column).array().isFinite();
  };
  if (time.index >= 0) check(time.index);
  std::vector<std::string> roles;
  for (const auto& [role, columns] : map.roles) {
    if (role == "t") continue;
    const bool needed = role == "q" || role == "dq" || role == "tau";
    Eigen::Index holes = 0;
    for (const auto& column : columns)
      holes = std::max<Eigen::Index>(holes, (!table.values.col(column.index).array().isFinite()).count());
    if (!needed && double(holes) > part_incomplete * double(table.values.rows())) {
      for (const auto& column : columns)
        log.unread.push_back(table.names[static_cast<std::size_t>(column.index)]);
      continue;
    }
    for (const auto& column : columns) check(column.index);
    roles.push_back(role);
  }
  const Eigen::Index holes = (!whole).count();
  if (holes > 0) {
    const Eigen::Index first =
        static_cast<Eigen::Index>(std::find(whole.begin(), whole.end(), false) - whole.begin());
    const std::string where = path + ":" + std::to_string(table.lines[static_cast<std::size_t>(first)]);
    if (double(holes) > part_incomplete * double(table.values.rows())) {
      std::string column;
      for (Eigen::Index k = 0; k < table.values.cols() && column.empty(); ++k) {
        const bool read = std::any_of(map.roles.begin(), map.roles.end(), [&](const auto& entry) {
          return std::any_of(entry.second.begin(), entry.second.end(),
                             [&](const auto& c) { return c.index == k; });
        });
        if (read && !std::isfinite(table.values(first, k))) column = table.names[static_cast<std::size_t>(k)];
      }
      throw Error(where + ": column " + column + " has no number, and so have " + std::to_string(holes) +
                  " of " + std::to_string(table.values.rows()) + " rows: at most a tenth may be incomplete");
    }
    log.notes.push_back({"incomplete_rows",
                         {},
                         double(holes),
                         "1",
                         std::to_string(holes) +
                             " rows with a number missing are left out, the first at line " +
                             std::to_string(table.lines[static_cast<std::size_t>(first)])});
    std::vector<Eigen::Index> kept;
    std::vector<long> lines;
    for (Eigen::Index i = 0; i < whole.size(); ++i)
      if (whole[i]) kept.push_back(i), lines.push_back(table.lines[static_cast<std::size_t>(i)]);
    table.values = Eigen::MatrixXd(table.values(kept, Eigen::all));
    table.lines = lines;
  }

  Eigen::MatrixXd Log::*const members[] = {&Log::q,       &Log::dq,    &Log::tau,  &Log::ddq, &Log::u,
                                           &Log::tau_cmd, &Log::theta, &Log::temp, &Log::i};
  const char* const keys[] = {"q", "dq", "tau", "ddq", "u", "tau_cmd", "theta", "temp", "i"};
  for (std::size_t m = 0; m < std::size(keys); ++m) {
    if (std::find(roles.begin(), roles.end(), keys[m]) == roles.end()) continue;
    const auto& columns = map.roles.at(keys[m]);
    Eigen::MatrixXd& x = log.*members[m];
    x.resize(table.values.rows(), static_cast<Eigen::Index>(columns.size()));
    for (std::size_t j = 0; j < columns.size(); ++j) {
      const auto to = static_cast<Eigen::Index>(j);
      x.col(to) = table.values.col(columns[j].index);
      if (columns[j].factor != 1.0) x.col(to) *= columns[j].factor;
      log.columns[keys[m]].push_back(table.names[static_cast<std::size_t>(columns[j].index)]);
    }
  }
  for (const int k : map.unread) log.unread.push_back(table.names[static_cast<std::size_t>(k)]);
  if (!map.unit.empty())
    log.notes.push_back(
        {"header_unit", {}, 0.0, map.unit, "columns are in " + map.unit + ", as the header says: converted"});
  if (map.zero_based)
    log.notes.push_back({"zero_based", {}, 0.0, "1", "joints are counted from 0 in the file"});

  if (time.index >= 0) {
    log.t = table.values.col(time.index);
    log.columns["t"] = {table.names[static_cast<std::size_t>(time.index)]};
    if (time.factor != 1.0)
      log.t *= time.factor;
    else
      find_time_unit(log);
    for (Eigen::Index i = 1; i < log.t.size(); ++i) {
      if (log.t[i] >= log.t[i - 1]) continue;
      std::ostringstream text;
      text << path << ":" << table.lines[static_cast<std::size_t>(i)] << ": column "
           << log.columns["t"].front() << ": time goes back from " << log.t[i - 1] << " s to " << log.t[i]
           << " s";
      throw Error(text.str());
    }
  } else if (options.rate > 0.0) {
    log.t = Eigen::VectorXd::LinSpaced(log.samples(), 0.0, double(log.samples() - 1)) / options.rate;
    log.notes.push_back({"made_time", {}, options.rate, "Hz", "the log has no time: made from --rate"});
  }
  if (options.unwrap) unwrap(log);
  return log;
}

Log read_log(const std::string& path, int joints, const LogColumns& required) {
  LogOptions options;
  options.joints = joints;
  options.required = required;
  return read_log(path, options);
}

void write_log(const std::string& path, const Log& log) {
  const std::pair<const char*, const Eigen::MatrixXd*> groups[] = {{"q", &log.q},
                                                                   {"dq", &log.dq},
                                                                   {"tau", &log.tau},
                                                                   {"ddq", &log.ddq},
                                                                   {"tau_cmd", &log.tau_cmd},
                                                                   {"theta", &log.theta},
                                                                   {"temp", &log.temp},
                                                                   {"u", &log.u},
                                                                   {"i", &log.i}};
  std::vector<std::string> names;
  Eigen::MatrixXd values(log.samples(), (log.t.size() > 0 ? 1 : 0) + 9 * log.q.cols());
  Eigen::Index column = 0;
  if (log.t.size() > 0) {
    if (log.t.size() != log.samples()) throw Error(path + ": column t has another length than the positions");
    names.emplace_back("t");
    values.col(column++) = log.t;
  }
  for (const auto& [prefix, group] : groups) {
    if (group->size() == 0) continue;
    if (group->rows() != log.samples() || group->cols() != log.q.cols())
      throw Error(path + ": columns " + prefix + "1.. have another size than the positions");
    for (const std::string& name : column_names(prefix, log.joints())) names.push_back(name);
    values.middleCols(column, group->cols()) = *group;
    column += group->cols();
  }
  values.conservativeResize(Eigen::NoChange, column);
  write_table(path, names, values);
}

}  // namespace dynid
