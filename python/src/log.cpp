// SPDX-License-Identifier: Apache-2.0
//
// dynid.Log, and how logs of other kinds come in: as tables of named columns, read by the rules of CSV.
#include "log.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "binding.hpp"
#include "cli/log_reader.hpp"
#include "dynid/base/error.hpp"
#include "dynid/signal/table_log.hpp"

namespace dynid::python {
namespace {

using nb::literals::operator""_a;
using Column = nb::ndarray<const double, nb::ndim<1>, nb::device::cpu>;

/// A read-only view that keeps its log alive; None where nothing was recorded.
nb::object view(nb::handle self, const Eigen::MatrixXd& x) {
  if (x.size() == 0) return nb::none();
  const std::size_t shape[2] = {static_cast<std::size_t>(x.rows()), static_cast<std::size_t>(x.cols())};
  const std::int64_t strides[2] = {1, x.rows()};
  return nb::cast(nb::ndarray<nb::numpy, const double>(x.data(), 2, shape, self, strides));
}

nb::object view(nb::handle self, const Eigen::VectorXd& x) {
  if (x.size() == 0) return nb::none();
  const std::size_t shape[1] = {static_cast<std::size_t>(x.size())};
  return nb::cast(nb::ndarray<nb::numpy, const double>(x.data(), 1, shape, self));
}

LogOptions options_of(int joints, const std::vector<std::string>& joint_names, const std::string& columns,
                      double rate) {
  LogOptions options;
  options.joints = joints;
  options.joint_names = joint_names;
  if (!columns.empty()) options.columns = parse_columns(columns);
  options.rate = rate;
  options.required.dq = options.required.tau = false;  // said by the job that needs them
  options.required.t = rate <= 0.0;
  return options;
}

Table table_of(const std::string& source, const std::vector<std::string>& names,
               const std::vector<Column>& columns) {
  Table table;
  table.source = source;
  table.names = names;
  const auto rows = columns.empty() ? 0 : static_cast<Eigen::Index>(columns.front().shape(0));
  if (rows == 0) throw Error(source + ": no samples");
  if (names.size() != columns.size()) throw Error(source + ": as many names as columns are needed");
  table.values.resize(rows, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const Column& column = columns[k];
    if (static_cast<Eigen::Index>(column.shape(0)) != rows)
      throw Error(source + ": column " + names[k] + " has " + std::to_string(column.shape(0)) +
                  " rows, the first one " + std::to_string(rows));
    const Eigen::Map<const Eigen::VectorXd, 0, Eigen::InnerStride<>> values(
        column.data(), rows, Eigen::InnerStride<>(column.stride(0)));
    table.values.col(static_cast<Eigen::Index>(k)) = values;
  }
  return table;
}

std::string joints_text(const std::vector<int>& joints) {
  std::string text;
  for (const int j : joints) text += (text.empty() ? "" : ", ") + std::to_string(j);
  return text;
}

}  // namespace

std::vector<Log> logs_of(const std::vector<PyLog>& logs, bool need_dq, bool need_tau) {
  std::vector<Log> out;
  for (const PyLog& log : logs) {
    if (need_dq && log->dq.size() == 0) throw Error(log->source + ": column dq1 is missing");
    if (need_tau && log->tau.size() == 0) throw Error(log->source + ": column tau1 is missing");
    out.push_back(*log);
  }
  return out;
}

void bind_log(nb::module_& m) {
  nb::class_<Log> log(
      m, "Log",
      "What a robot recorded: samples of n joints, base to tip, in SI units. Arrays are read-only views;\n"
      "a quantity that was not recorded is None.");
  log.def_prop_ro("source", [](const Log& l) { return l.source; })
      .def_prop_ro("n", [](const Log& l) { return l.joints(); })
      .def("__len__", [](const Log& l) { return l.samples(); })
      .def_prop_ro(
          "columns", [](const Log& l) { return l.columns; }, "What was read as what.")
      .def_prop_ro("unread", [](const Log& l) { return l.unread; })
      .def_prop_ro(
          "notes",
          [](const Log& l) {
            std::vector<std::string> notes;
            for (const LogNote& note : l.notes)
              notes.push_back(note.text +
                              (note.joints.empty() ? "" : " (joints " + joints_text(note.joints) + ")"));
            return notes;
          })
      .def(
          "write", [](const Log& l, const std::string& path) { write_log(path, l); }, "path"_a,
          "Writes it as CSV, every number reading back to the same double.");
  log.def_prop_ro(
      "t", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).t); }, "[s]: (samples,).");
  log.def_prop_ro(
      "q", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).q); },
      "[rad or m]: (samples, n).");
  log.def_prop_ro(
      "dq", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).dq); },
      "[rad/s or m/s]: (samples, n).");
  log.def_prop_ro(
      "tau", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).tau); },
      "[N m or N]: (samples, n).");
  log.def_prop_ro(
      "ddq", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).ddq); },
      "[rad/s^2]: (samples, n).");
  log.def_prop_ro(
      "u", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).u); },
      "Commanded positions [rad or m]: (samples, n).");
  log.def_prop_ro(
      "i", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).i); },
      "Motor currents [A]: (samples, n).");
  log.def_prop_ro("tau_cmd", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).tau_cmd); });
  log.def_prop_ro("theta", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).theta); });
  log.def_prop_ro("temp", [](nb::handle self) { return view(self, nb::cast<const Log&>(self).temp); });

  m.def(
      "read_csv",
      [](const std::string& path, int joints, const std::vector<std::string>& joint_names,
         const std::string& columns, double rate) {
        const nb::gil_scoped_release release;
        return std::make_shared<Log>(read_log(path, options_of(joints, joint_names, columns, rate)));
      },
      "path"_a, "joints"_a = 0, "joint_names"_a = std::vector<std::string>(), "columns"_a = "",
      "rate"_a = 0.0);
  m.def(
      "log_of",
      [](const std::string& source, const std::vector<std::string>& names, const std::vector<Column>& values,
         int joints, const std::vector<std::string>& joint_names, const std::string& columns, double rate) {
        Table table = table_of(source, names, values);
        const nb::gil_scoped_release release;
        return std::make_shared<Log>(
            log_of(std::move(table), options_of(joints, joint_names, columns, rate)));
      },
      "source"_a, "names"_a, "values"_a, "joints"_a = 0, "joint_names"_a = std::vector<std::string>(),
      "columns"_a = "", "rate"_a = 0.0);
  // For the program: `read(path, joint_names, topic)` gives (names, columns), or None for what is the
  // program's.
  m.def("set_log_reader", [](nb::callable read) {
    const auto* kept = new nb::callable(std::move(read));  // for ever, as the program's
    set_log_reader([kept](const std::string& path, const LogOptions& options,
                          const std::string& topic) -> std::optional<Log> {
      Table table;
      {
        const nb::gil_scoped_acquire acquire;
        try {
          const nb::object found = (*kept)(path, options.joint_names, topic);
          if (found.is_none()) return std::nullopt;
          const auto both = nb::cast<nb::tuple>(found);
          table = table_of(path, nb::cast<std::vector<std::string>>(both[0]),
                           nb::cast<std::vector<Column>>(both[1]));
        } catch (nb::python_error& error) {
          throw Error(nb::cast<std::string>(nb::str(error.value())));
        }
      }
      return log_of(std::move(table), options);
    });
  });
}

}  // namespace dynid::python
