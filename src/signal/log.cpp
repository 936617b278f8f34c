// SPDX-License-Identifier: Apache-2.0
#include "dynid/signal/log.hpp"

#include <sstream>

#include "dynid/base/error.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {

Log read_log(const std::string& path, int joints, const LogColumns& required) {
  const Table table = read_table(path);
  const int found = table.count("q");
  if (found == 0) throw Error(path + ": column q1 is missing");
  if (joints == 0) joints = found;
  if (found != joints)
    throw Error(path + ": the log has " + std::to_string(found) + " joints (q1..q" + std::to_string(found) +
                "), the robot has " + std::to_string(joints));

  Log log;
  log.source = path;
  log.q = table.group("q", joints, true);
  log.dq = table.group("dq", joints, required.dq);
  log.tau = table.group("tau", joints, required.tau);
  log.ddq = table.group("ddq", joints, false);
  log.tau_cmd = table.group("tau_cmd", joints, false);
  log.theta = table.group("theta", joints, false);
  log.temp = table.group("temp", joints, false);
  log.u = table.group("u", joints, false);

  const int time = table.find("t");
  if (time < 0 && required.t) throw Error(path + ": column t is missing");
  if (time >= 0) log.t = table.values.col(time);
  for (Eigen::Index i = 1; i < log.t.size(); ++i) {
    if (log.t[i] >= log.t[i - 1]) continue;
    std::ostringstream text;
    text << path << ":" << table.lines[static_cast<std::size_t>(i)] << ": column t: time goes back from "
         << log.t[i - 1] << " s to " << log.t[i] << " s";
    throw Error(text.str());
  }
  return log;
}

void write_log(const std::string& path, const Log& log) {
  const std::pair<const char*, const Eigen::MatrixXd*> groups[] = {{"q", &log.q},
                                                                   {"dq", &log.dq},
                                                                   {"tau", &log.tau},
                                                                   {"ddq", &log.ddq},
                                                                   {"tau_cmd", &log.tau_cmd},
                                                                   {"theta", &log.theta},
                                                                   {"temp", &log.temp},
                                                                   {"u", &log.u}};
  std::vector<std::string> names;
  Eigen::MatrixXd values(log.samples(), (log.t.size() > 0 ? 1 : 0) + 8 * log.q.cols());
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
