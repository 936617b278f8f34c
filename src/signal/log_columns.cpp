// SPDX-License-Identifier: Apache-2.0
#include "log_columns.hpp"

#include <algorithm>
#include <cctype>
#include <optional>
#include <set>

#include "dynid/base/error.hpp"

namespace dynid::detail {
namespace {

constexpr double degree = 3.14159265358979323846 / 180.0;
const std::set<std::string> roles = {"t", "q", "dq", "tau", "ddq", "u", "i", "tau_cmd", "theta", "temp"};

/// Words for a quantity, the likeliest first: where two columns of one joint match, the earlier word is read.
const std::vector<std::pair<std::string, std::vector<std::string>>>& words() {
  static const std::vector<std::pair<std::string, std::vector<std::string>>> list = {
      {"q",
       {"q", "actual_q", "q_actual", "q_meas", "q_measured", "measured_q", "pos", "position", "positions",
        "joint_pos", "joint_position", "joint_positions", "actual_position", "position_actual", "qpos",
        "angle", "joint_angle"}},
      {"dq",
       {"dq", "qd", "qdot", "q_dot", "actual_qd", "dq_meas", "dq_measured", "measured_dq", "vel", "velocity",
        "velocities", "joint_vel", "joint_velocity", "joint_velocities", "actual_velocity", "qvel", "speed"}},
      {"tau",
       {"tau", "tau_j", "tau_meas", "tau_measured", "measured_tau", "eff", "effort", "efforts", "torque",
        "torques", "trq", "joint_torque", "joint_effort", "joint_torques", "actual_torque", "actual_effort",
        "measured_torque", "actual_current_as_torque"}},
      {"ddq",
       {"ddq", "qdd", "qddot", "q_ddot", "acc", "acceleration", "accelerations", "joint_acceleration"}},
      {"u",
       {"u", "q_cmd", "q_des", "q_desired", "q_d", "q_ref", "target_q", "desired_q", "q_command",
        "position_command", "commanded_position", "desired_position", "target_position", "reference"}},
      {"i",
       {"i", "current", "currents", "actual_current", "motor_current", "joint_current", "measured_current"}},
      {"tau_cmd",
       {"tau_cmd", "tau_des", "tau_desired", "tau_d", "tau_j_d", "tau_command", "target_moment",
        "effort_command", "torque_command", "commanded_torque", "desired_torque"}},
      {"theta", {"theta", "motor_pos", "motor_position", "q_motor"}},
      {"temp",
       {"temp", "temperature", "temperatures", "joint_temperature", "joint_temperatures",
        "motor_temperature"}},
  };
  return list;
}

const std::vector<std::string>& time_words() {
  static const std::vector<std::string> list = {
      "t",       "time", "timestamp", "stamp",   "field_header_stamp", "header_stamp", "time_s",
      "elapsed", "secs", "seconds",   "ros_time"};
  return list;
}

/// What stands before a quantity's word in the names that tools write.
const std::vector<std::string> prefixes = {"field_",       "joint_states_", "joint_state_",
                                           "robot_state_", "franka_state_", "robot_",
                                           "state_",       "joints_",       "data_"};

/// Lower case, `_` for whatever parts words; a unit in brackets at the end apart.
struct Name {
  std::string text, unit;
};

Name cleaned(std::string raw) {
  Name name;
  while (!raw.empty() && std::isspace(static_cast<unsigned char>(raw.back()))) raw.pop_back();
  const char last = raw.empty() ? '\0' : raw.back();
  if (last == ')' || last == ']') {
    const auto open = raw.rfind(last == ')' ? '(' : '[');
    const std::string inside = open == std::string::npos ? "" : raw.substr(open + 1, raw.size() - open - 2);
    if (!inside.empty() && !std::isdigit(static_cast<unsigned char>(inside.front())) && open > 0) {
      name.unit = inside;
      raw.resize(open);
    }
  }
  for (const char c : raw) {
    const auto x = static_cast<unsigned char>(c);
    if (std::isalnum(x) || x >= 0x80)
      name.text.push_back(static_cast<char>(std::tolower(x)));
    else if (!name.text.empty() && name.text.back() != '_')
      name.text.push_back('_');
  }
  while (!name.text.empty() && name.text.back() == '_') name.text.pop_back();
  return name;
}

std::optional<double> unit_factor(const std::string& role, std::string unit) {
  unit.erase(std::remove(unit.begin(), unit.end(), ' '), unit.end());
  if (role == "t") {
    if (unit == "ms") return 1e-3;
    if (unit == "us" || unit == "\xC2\xB5s") return 1e-6;
    if (unit == "ns") return 1e-9;
  }
  if ((role == "q" || role == "u" || role == "theta") &&
      (unit == "deg" || unit == "\xC2\xB0" || unit == "degrees"))
    return degree;
  if ((role == "dq" && (unit == "deg/s" || unit == "\xC2\xB0/s")) || (role == "ddq" && unit == "deg/s^2"))
    return degree;
  if (role == "dq" && unit == "rpm") return 6.0 * degree;
  if ((role == "tau" || role == "tau_cmd") &&
      (unit == "Nmm" || unit == "mNm" || unit == "N*mm" || unit == "N.mm"))
    return 1e-3;
  if (role == "i" && unit == "mA") return 1e-3;
  return std::nullopt;
}

bool ends_with(const std::string& text, const std::string& tail) {
  return text.size() >= tail.size() && text.compare(text.size() - tail.size(), tail.size(), tail) == 0;
}

/// The digits at the end of `text` as a number, and what stands before them without `_`; -1 where there are
/// none.
int trailing_number(std::string& text) {
  std::size_t at = text.size();
  while (at > 0 && std::isdigit(static_cast<unsigned char>(text[at - 1]))) --at;
  if (at == text.size() || text.size() - at > 3) return -1;
  const int number = std::stoi(text.substr(at));
  text.resize(at);
  while (!text.empty() && text.back() == '_') text.pop_back();
  return number;
}

/// A word for a quantity: role and how likely a word it is (less is likelier).
struct Word {
  std::string role;
  int rank = 0;
};
std::optional<Word> word_of(std::string text) {
  for (int pass = 0; pass < 3; ++pass) {
    for (const auto& [role, list] : words())
      for (std::size_t k = 0; k < list.size(); ++k)
        if (list[k] == text) return Word{role, static_cast<int>(k) + 100 * pass};
    const auto before = text;
    for (const std::string& prefix : prefixes)
      if (text.compare(0, prefix.size(), prefix) == 0) {
        text.erase(0, prefix.size());
        break;
      }
    if (text == before) break;
  }
  return std::nullopt;
}

bool is_joint_word(const std::string& text) {
  for (const char* word : {"joint", "j", "axis", "a"})
    if (text == word || ends_with(text, std::string("_") + word) || ends_with(text, "joint")) return true;
  return false;
}

struct Match {
  std::string role;
  int joint = 0;  ///< as counted in the file, or from 1 by name
  int rank = 0;
  bool by_name = false;
};

/// `<joint>_<word>` or `<word>_<joint>`, for a joint's name, the longest that fits.
std::optional<Match> match_joint(const std::string& text, const std::vector<std::string>& joints) {
  std::optional<Match> best;
  std::size_t length = 0;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::string& joint = joints[j];
    if (joint.size() < length || joint.empty()) continue;
    std::string rest;
    const auto at = text.find(joint);
    if (at == std::string::npos) continue;
    const std::size_t end = at + joint.size();
    if (end < text.size() && text[end] == '_' && (at == 0 || text[at - 1] == '_'))
      rest = text.substr(end + 1);
    else if (end == text.size() && at > 0 && text[at - 1] == '_')
      rest = text.substr(0, at - 1);
    else
      continue;
    const auto word = word_of(rest);
    if (!word) continue;
    best = Match{word->role, static_cast<int>(j) + 1, word->rank, true};
    length = joint.size();
  }
  return best;
}

std::optional<Match> match_number(const std::string& text) {
  std::string stem = text;
  const int number = trailing_number(stem);
  if (number >= 0) {
    if (const auto word = word_of(stem)) return Match{word->role, number, word->rank, false};
    // position_joint1
    for (const char* tail : {"_joint", "_j", "_axis"})
      if (ends_with(stem, tail))
        if (const auto word = word_of(stem.substr(0, stem.size() - std::string(tail).size())))
          return Match{word->role, number, word->rank + 20, false};
  }
  // joint1_position, panda_joint1_velocity
  for (auto at = text.find('_'); at != std::string::npos; at = text.find('_', at + 1)) {
    std::string head = text.substr(0, at);
    const int joint = trailing_number(head);
    if (joint < 0 || !is_joint_word(head)) continue;
    if (const auto word = word_of(text.substr(at + 1)))
      return Match{word->role, joint, word->rank + 20, false};
  }
  return std::nullopt;
}

/// Joint that `name` has under `pattern`; -1 where it does not fit.
int under_pattern(const std::string& name, const std::string& pattern, const std::vector<std::string>& joints,
                  bool& by_name) {
  auto hole = pattern.find("{}");
  std::size_t width = 2;
  if (hole == std::string::npos) hole = pattern.find('#'), width = 1;
  by_name = false;
  if (hole == std::string::npos) return name == pattern ? 1 : -1;
  const std::string head = pattern.substr(0, hole), tail = pattern.substr(hole + width);
  if (name.size() < head.size() + tail.size() + 1 || name.compare(0, head.size(), head) != 0 ||
      !ends_with(name, tail))
    return -1;
  const std::string middle = name.substr(head.size(), name.size() - head.size() - tail.size());
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (joints[j] == middle) {
      by_name = true;
      return static_cast<int>(j) + 1;
    }
  if (middle.size() > 3 ||
      !std::all_of(middle.begin(), middle.end(), [](unsigned char c) { return std::isdigit(c); }))
    return -1;
  return std::stoi(middle);
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t k = 0; k < names.size() && k < 12; ++k) text += (k ? ", " : "") + names[k];
  return names.size() > 12 ? text + ", ..." : text;
}

struct Found {
  int column = -1, rank = 0;
};

}  // namespace

ColumnMap map_columns(const std::string& source, const std::vector<std::string>& names,
                      const LogOptions& options) {
  std::vector<Name> clean;
  std::vector<std::string> joints;
  for (const std::string& name : names) clean.push_back(cleaned(name));
  for (const std::string& joint : options.joint_names) joints.push_back(cleaned(joint).text);
  std::map<std::string, std::map<int, Found>> by_number, by_name, given;
  std::vector<int> times;

  const auto put = [&](std::map<int, Found>& place, int joint, int column, int rank,
                       const std::string& role) {
    const auto [it, inserted] = place.insert({joint, {column, rank}});
    if (inserted) return;
    if (it->second.rank == rank)
      throw Error(source + ": columns " + names[static_cast<std::size_t>(it->second.column)] + " and " +
                  names[static_cast<std::size_t>(column)] + " both look like " + role +
                  std::to_string(joint) + ": say which with --columns \"" + role + "=NAME#\"");
    if (rank < it->second.rank) it->second = {column, rank};
  };
  for (const auto& [role, pattern] : options.columns)
    if (roles.count(role) == 0)
      throw Error("--columns: unknown role '" + role +
                  "' (known: " + listed(std::vector<std::string>(roles.begin(), roles.end())) + ")");
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto column = static_cast<int>(k);
    bool taken = false;
    for (const auto& [role, pattern] : options.columns) {
      bool named = false;
      const int joint = under_pattern(names[k], pattern, options.joint_names, named);
      if (joint < 0) continue;
      if (role == "t")
        times.insert(times.begin(), column);
      else
        put(given[role], joint, column, 0, role);
      taken = true;
    }
    if (taken) continue;
    const std::string& text = clean[k].text;
    if (options.columns.count("t") == 0 &&
        std::find(time_words().begin(), time_words().end(), text) != time_words().end()) {
      times.push_back(column);
      continue;
    }
    if (const auto match = match_joint(text, joints)) {
      put(by_name[match->role], match->joint, column, match->rank, match->role);
      continue;
    }
    if (const auto match = match_number(text))
      put(by_number[match->role], match->joint, column, match->rank, match->role);
  }

  ColumnMap map;
  const int wanted = options.joints > 0 ? options.joints : static_cast<int>(options.joint_names.size());
  int n = wanted;
  std::set<int> used;
  const auto take = [&](const std::string& role, const std::map<int, Found>& from, bool named, int count,
                        bool complete) {
    const bool zero = !named && from.count(0) > 0;
    std::vector<ColumnMap::Column> columns;
    for (int j = 0; j < count; ++j) {
      const auto it = from.find(zero ? j : j + 1);
      if (it == from.end()) {
        if (!complete) return;  // the caller says what is missing
        throw Error(source + ": column " + role + std::to_string(zero ? j : j + 1) + " is missing");
      }
      ColumnMap::Column column{it->second.column, 1.0};
      const Name& name = clean[static_cast<std::size_t>(column.index)];
      if (const auto factor = unit_factor(role, name.unit)) column.factor = *factor, map.unit = name.unit;
      columns.push_back(column);
      used.insert(column.index);
    }
    map.zero_based = map.zero_based || zero;
    map.roles[role] = columns;
  };

  std::vector<std::string> order = {"q"};
  for (const std::string& role : roles)
    if (role != "q" && role != "t") order.push_back(role);
  for (const std::string& role : order) {
    const bool asked = options.columns.count(role) > 0;
    const bool named = !asked && by_name.count(role) > 0;
    const std::map<int, Found>& from = asked ? given[role] : named ? by_name[role] : by_number[role];
    if (asked && from.empty())
      throw Error(source + ": --columns: no column fits " + role + "=" + options.columns.at(role) +
                  " (columns: " + listed(names) + ")");
    if (from.empty()) {
      if (role == "q")
        throw Error(source + ": column q1 is missing (columns: " + listed(names) +
                    "; name them with --columns \"q=NAME#,dq=NAME#,tau=NAME#\")");
      continue;
    }
    const bool zero = !named && from.count(0) > 0;
    const int first = zero ? 0 : 1, last = from.rbegin()->first, found = last - first + 1;
    if (n == 0) n = found;
    if (role == "q" && found != n && !named) {
      const auto name = [&](int j) {
        const auto it = from.find(j);
        return it == from.end() ? "q" + std::to_string(j)
                                : names[static_cast<std::size_t>(it->second.column)];
      };
      std::string text = source + ": the log has " + std::to_string(found) + " joints (" + name(first) +
                         ".." + name(last) + "), the robot has " + std::to_string(n);
      if (found > n) {
        text += ": " + name(first + n) + (found > n + 1 ? ".." + name(last) : "") +
                " would be left over (another --tip, or --columns with the joints meant)";
      }
      throw Error(text);
    }
    take(role, from, named, n,
         role == "q" || (role == "dq" && options.required.dq) || (role == "tau" && options.required.tau) ||
             asked || (!named && found >= n));
  }
  // The stamps of the message before those of its arrival; whatever else, the likeliest word.
  if (!times.empty()) {
    int best = times.front();
    if (options.columns.count("t") == 0) {
      const auto rank = [&](int column) {
        const std::string& text = clean[static_cast<std::size_t>(column)].text;
        if (ends_with(text, "header_stamp")) return -1;
        return static_cast<int>(std::find(time_words().begin(), time_words().end(), text) -
                                time_words().begin());
      };
      for (const int column : times)
        if (rank(column) < rank(best)) best = column;
    }
    std::stable_partition(times.begin(), times.end(), [&](int column) { return column == best; });
    for (const int at : times) {
      ColumnMap::Column column{at, 1.0};
      const Name& name = clean[static_cast<std::size_t>(at)];
      if (const auto factor = unit_factor("t", name.unit)) column.factor = *factor;
      map.roles["t"].push_back(column);
    }
    used.insert(times.begin(), times.end());
  } else if (options.columns.count("t") > 0) {
    throw Error(source + ": --columns: no column is called " + options.columns.at("t") +
                " (columns: " + listed(names) + ")");
  }
  for (std::size_t k = 0; k < names.size(); ++k)
    if (used.count(static_cast<int>(k)) == 0) map.unread.push_back(static_cast<int>(k));
  return map;
}

}  // namespace dynid::detail
