// SPDX-License-Identifier: Apache-2.0
#include "dynid/signal/table.hpp"

#include <csv.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <set>
#include <string_view>
#include <system_error>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"

namespace dynid {
namespace {

/// What libcsv's callbacks fill, one line of the file at a time.
struct Reader {
  Table table;
  std::vector<std::vector<double>> columns;
  std::size_t line = 0;
  std::size_t field = 0;
  bool header = true;
  std::string error;

  std::string place() const { return table.source + ":" + std::to_string(line) + ": "; }

  void take(std::string_view text) {
    if (!error.empty()) return;
    if (header) {
      table.names.emplace_back(text);
      return;
    }
    const std::size_t k = field++;
    if (k >= columns.size()) return;  // counted, and reported at the end of the row
    double value = 0.0;
    const char* first = text.data();
    const char* last = first + text.size();
    if (first != last && *first == '+') ++first;
    const auto [end, code] = std::from_chars(first, last, value);
    if (code == std::errc::result_out_of_range && end == last) {
      error = place() + "column " + table.names[k] + ": '" + std::string(text) + "' is out of range";
    } else if (code != std::errc() || end != last) {
      error = place() + "column " + table.names[k] + ": '" + std::string(text) + "' is not a number";
    } else if (!std::isfinite(value)) {
      error = place() + "column " + table.names[k] + ": " + std::string(text) + " is not finite";
    } else {
      columns[k].push_back(value);
    }
  }

  void end_row() {
    if (!error.empty()) return;
    if (header) {
      header = false;
      std::set<std::string> seen;
      for (const std::string& name : table.names) {
        if (name.empty()) error = place() + "the header has a column without a name";
        if (!seen.insert(name).second) error = place() + "the header names column " + name + " twice";
      }
      columns.resize(table.names.size());
    } else {
      if (field != columns.size())
        error = place() + "the row has " + std::to_string(field) + " fields, the header names " +
                std::to_string(columns.size());
      table.lines.push_back(static_cast<long>(line));
    }
    field = 0;
  }
};

void on_field(void* text, std::size_t size, void* reader) {
  static_cast<Reader*>(reader)->take({static_cast<const char*>(text), size});
}
void on_row(int, void* reader) { static_cast<Reader*>(reader)->end_row(); }

struct CsvFree {
  void operator()(csv_parser* p) const {
    csv_free(p);
    delete p;
  }
};

}  // namespace

int Table::find(const std::string& name) const noexcept {
  const auto it = std::find(names.begin(), names.end(), name);
  return it == names.end() ? -1 : static_cast<int>(it - names.begin());
}

Eigen::MatrixXd Table::group(const std::string& prefix, int n, bool required) const {
  const std::vector<std::string> wanted = column_names(prefix, n);
  const auto present = [&](const std::string& name) { return find(name) >= 0; };
  if (!required && std::none_of(wanted.begin(), wanted.end(), present)) return {};
  Eigen::MatrixXd out(values.rows(), n);
  for (int j = 0; j < n; ++j) {
    const int k = find(wanted[static_cast<std::size_t>(j)]);
    if (k < 0) throw Error(source + ": column " + wanted[static_cast<std::size_t>(j)] + " is missing");
    out.col(j) = values.col(k);
  }
  return out;
}

int Table::count(const std::string& prefix) const noexcept {
  int most = 0;
  for (const std::string& name : names) {
    if (name.size() <= prefix.size() || name.compare(0, prefix.size(), prefix) != 0) continue;
    int k = 0;
    const char* last = name.data() + name.size();
    const auto [end, code] = std::from_chars(name.data() + prefix.size(), last, k);
    if (code == std::errc() && end == last) most = std::max(most, k);
  }
  return most;
}

Table read_table(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(path + ": cannot be read: " + std::strerror(errno));
  Reader reader;
  reader.table.source = path;
  std::unique_ptr<csv_parser, CsvFree> parser(new csv_parser);
  if (csv_init(parser.get(), CSV_STRICT) != 0) throw Error(path + ": cannot start the CSV parser");

  // Line by line, so that every message can name its line.
  std::string text;
  while (std::getline(file, text)) {
    ++reader.line;
    if (!text.empty() && text.back() == '\r') text.pop_back();
    if (text.empty() || text.front() == '#') continue;
    text.push_back('\n');
    if (csv_parse(parser.get(), text.data(), text.size(), on_field, on_row, &reader) != text.size())
      throw Error(reader.place() + csv_strerror(csv_error(parser.get())));
    if (!reader.error.empty()) throw Error(reader.error);
  }
  if (file.bad()) throw Error(path + ": cannot be read: " + std::strerror(errno));
  if (reader.header)
    throw Error(path + ": the file is empty: a header line that names the columns is expected");
  if (reader.table.lines.empty()) throw Error(path + ": no row of numbers follows the header");

  Table& table = reader.table;
  table.values.resize(static_cast<Eigen::Index>(table.lines.size()),
                      static_cast<Eigen::Index>(table.names.size()));
  for (std::size_t k = 0; k < reader.columns.size(); ++k) {
    std::vector<double>& column = reader.columns[k];
    table.values.col(static_cast<Eigen::Index>(k)) =
        Eigen::Map<const Eigen::VectorXd>(column.data(), static_cast<Eigen::Index>(column.size()));
    std::vector<double>().swap(column);  // a log of hours should not stand in memory twice
  }
  return std::move(table);
}

void write_table(const std::string& path, const std::vector<std::string>& names,
                 const Eigen::MatrixXd& values) {
  if (static_cast<std::size_t>(values.cols()) != names.size())
    throw Error(path + ": " + std::to_string(values.cols()) + " columns of numbers for " +
                std::to_string(names.size()) + " names");
  std::string text;
  text.reserve(static_cast<std::size_t>(values.size()) * 20 + 256);
  for (std::size_t k = 0; k < names.size(); ++k) text.append(k ? "," : "").append(names[k]);
  text.push_back('\n');
  char number[32];
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    for (Eigen::Index k = 0; k < values.cols(); ++k) {
      if (k > 0) text.push_back(',');
      text.append(number, std::to_chars(number, number + sizeof number, values(i, k)).ptr);
    }
    text.push_back('\n');
  }
  write_file(path, text);
}

std::vector<std::string> column_names(const std::string& prefix, int n) {
  std::vector<std::string> names;
  for (int j = 1; j <= n; ++j) names.push_back(prefix + std::to_string(j));
  return names;
}

}  // namespace dynid
