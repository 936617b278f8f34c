// SPDX-License-Identifier: Apache-2.0
#include "dynid/signal/table.hpp"

#include <csv.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
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
  bool lenient = false;
  std::vector<std::vector<double>> columns;
  std::size_t line = 0;
  std::size_t field = 0;
  std::size_t ended = 0;  ///< rows, the header among them
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
    auto [end, code] = std::from_chars(first, last, value);
    std::string point;
    if (code == std::errc() && end != last && *end == ',') {  // within a field, it is a decimal comma
      point.assign(first, last);
      point[static_cast<std::size_t>(end - first)] = '.';
      const auto [stop, again] = std::from_chars(point.data(), point.data() + point.size(), value);
      if (again == std::errc() && stop == point.data() + point.size()) end = last;
    }
    if (code == std::errc() && end == last && std::isfinite(value)) {
      columns[k].push_back(value);
      return;
    }
    const std::string what =
        code == std::errc::result_out_of_range && end == last ? "'" + std::string(text) + "' is out of range"
        : code != std::errc() || end != last                  ? "'" + std::string(text) + "' is not a number"
                                                              : std::string(text) + " is not finite";
    if (!lenient) {
      error = place() + "column " + table.names[k] + ": " + what;
      return;
    }
    columns[k].push_back(std::numeric_limits<double>::quiet_NaN());
    if (!stands_for_nothing(text) && table.not_numbers[k].empty() && !(code == std::errc() && end == last))
      table.not_numbers[k] = place() + "column " + table.names[k] + ": " + what;
  }

  /// Room for as many rows as a file of `size` bytes will have, by those read so far.
  void reserve(std::ifstream& file, double size) {
    constexpr double room = 1.02, most = 1e9;
    const auto here = static_cast<double>(file.tellg());
    if (!(here > 0.0) || !(size > here)) return;
    const double rows = std::min(most, room * size / here * double(table.lines.size()));
    for (std::vector<double>& column : columns) column.reserve(static_cast<std::size_t>(rows));
    table.lines.reserve(static_cast<std::size_t>(rows));
  }

  /// What programs write where there is no number.
  static bool stands_for_nothing(std::string_view text) {
    std::string lower(text);
    for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return lower.empty() || lower == "nan" || lower == "-nan" || lower == "null" || lower == "none" ||
           lower == "na" || lower == "n/a" || lower == "-" || lower == "inf" || lower == "-inf";
  }

  void end_row() {
    ++ended;
    if (!error.empty()) return;
    if (header) {
      end_header();
    } else {
      if (field != columns.size())
        error = place() + "the row has " + std::to_string(field) + " fields, the header names " +
                std::to_string(columns.size()) + hint();
      table.lines.push_back(static_cast<long>(line));
    }
    field = 0;
  }

  void end_header() {
    header = false;
    if (table.names.size() > 1 && table.names.back().empty())
      table.names.pop_back();  // a separator at the end
    // pandas leaves the name of its row numbers empty.
    if (lenient && table.names.size() > 1 && table.names.front().empty()) table.names.front() = "index";
    std::set<std::string> seen;
    for (const std::string& name : table.names) {
      if (name.empty()) error = place() + "the header has a column without a name";
      if (!seen.insert(name).second && !lenient)
        error = place() + "the header names column " + name + " twice";
    }
    columns.resize(table.names.size());
    table.not_numbers.resize(table.names.size());
  }

  std::string hint() const {
    if (field + 1 >= 2 * columns.size() - 1 && field <= 2 * columns.size() && field > columns.size())
      return " (decimal commas between commas? separate the columns by semicolons)";
    if (field == 1 && columns.size() > 1) return " (cut short, or separated otherwise than the header?)";
    return "";
  }
};

/// What a file is that is no text, and what to do with it, by its first bytes; empty when nothing is known
/// against it.
std::string other_kind(std::string_view start, const std::string& path) {
  const auto starts = [&](std::string_view with) { return start.substr(0, with.size()) == with; };
  const auto ends = [&](std::string_view with) {
    return path.size() >= with.size() && std::string_view(path).substr(path.size() - with.size()) == with;
  };
  const std::string python = "; dynid's Python package reads it, or write it as CSV";
  if (starts(std::string_view("SQLite format 3\0", 16)))
    return "this is a ROS 2 bag (sqlite3): convert it with `ros2 bag convert` or `rosbags-convert` to a ROS "
           "1 bag" +
           python;
  if (starts("\x89MCAP0\r\n"))
    return "this is an MCAP file (a ROS 2 bag): convert it with `rosbags-convert`" + python;
  if (starts("#ROSBAG V"))
    return "this is a ROS 1 bag: only the program and nodes built with ROS read it, by its name in .bag";
  if (starts("PAR1")) return "this is a parquet file" + python + " (pandas: to_csv)";
  if (starts("\x93NUMPY")) return "this is a NumPy array (.npy)" + python + " (numpy.savetxt with a header)";
  if (starts("PK\x03\x04"))
    return ends(".npz")    ? "these are NumPy arrays (.npz)" + python + " (numpy.savetxt with a header)"
           : ends(".xlsx") ? std::string("this is an Excel workbook: save it as CSV")
                           : std::string("this is a zip archive: unpack it");
  if (starts("MATLAB 5.0")) return "this is a MATLAB file (.mat)" + python + " (MATLAB: writetable)";
  if (starts("\x89HDF\r\n")) return "this is an HDF5 file (also .mat of MATLAB 7.3)" + python;
  if (starts("\x1f\x8b")) return "this is compressed by gzip: gunzip it";
  if (starts("BZh")) return "this is compressed by bzip2: bunzip2 it";
  if (starts("\x28\xb5\x2f\xfd")) return "this is compressed by zstd: unzstd it";
  if (starts("\xd0\xcf\x11\xe0")) return "this is an Excel workbook: save it as CSV";
  if (starts("\xff\xfe") || starts("\xfe\xff")) return "the text is in UTF-16: save it as UTF-8";
  if (starts("<"))
    return "this is XML (a robot's URDF?), not a log: a header line of column names is expected";
  if (starts("{") || starts("[")) return "this is JSON, not CSV: a header line of column names is expected";
  if (start.find('\0') != std::string_view::npos)
    return "this is a binary file of a kind not known here: a CSV with a header line of column names is "
           "expected";
  return "";
}

char separator_of(const std::string& header) {
  bool quoted = false;
  int commas = 0, semicolons = 0, tabs = 0;
  for (const char c : header) {
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    commas += c == ',', semicolons += c == ';', tabs += c == '\t';
  }
  if (semicolons > 0) return ';';
  if (commas > 0) return ',';
  if (tabs > 0) return '\t';
  return header.find(' ') == std::string::npos ? ',' : ' ';
}

bool is_number(std::string_view text) {
  double value;
  while (!text.empty() && (text.front() == ' ' || text.front() == '+')) text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return !text.empty() && code == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

/// The fields of a line that has no quotes.
std::vector<std::string_view> fields_of(std::string_view line, char separator) {
  std::vector<std::string_view> fields;
  for (;;) {
    const auto end = line.find(separator);
    fields.push_back(line.substr(0, end));
    if (end == std::string_view::npos) return fields;
    line.remove_prefix(end + 1);
  }
}

bool all_numbers(const std::string& line) {
  for (const std::string_view field : fields_of(line, separator_of(line)))
    if (!is_number(field)) return false;
  return true;
}

/// Runs of blanks as one separator, none at the ends.
void squeeze(std::string& line) {
  std::string out;
  for (const char c : line) {
    const char x = c == '\t' ? ' ' : c;
    if (x != ' ' || (!out.empty() && out.back() != ' ')) out.push_back(x);
  }
  while (!out.empty() && out.back() == ' ') out.pop_back();
  line = out;
}

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

Table read_table(const std::string& path, const TableOptions& options) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(path + ": cannot be read: " + std::strerror(errno));
  Reader reader;
  reader.table.source = path;
  reader.lenient = options.lenient;
  std::string start(512, '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(file.gcount()));
  if (const std::string kind = other_kind(start, path); !kind.empty()) throw Error(path + ": " + kind);
  file.clear();
  file.seekg(0, std::ios::end);
  const auto size = static_cast<double>(file.tellg());  // negative where it cannot be told
  file.seekg(start.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0);
  std::unique_ptr<csv_parser, CsvFree> parser(new csv_parser);
  if (csv_init(parser.get(), CSV_STRICT) != 0) throw Error(path + ": cannot start the CSV parser");

  // Line by line, so that every message can name its line.
  std::string text, comment;
  char separator = ',';
  const auto parse = [&](std::string& line) {
    if (separator == ' ') squeeze(line);
    line.push_back('\n');
    const std::size_t before = reader.ended;
    const bool in_row = !reader.header;
    if (csv_parse(parser.get(), line.data(), line.size(), on_field, on_row, &reader) != line.size())
      throw Error(reader.place() + csv_strerror(csv_error(parser.get())));
    if (!reader.error.empty()) throw Error(reader.error);
    // Of a row that goes on in the next line some columns would have a number more than others.
    if (in_row && reader.ended == before && line.find('"') != std::string::npos)
      throw Error(reader.place() + "a quotation mark is not closed");
  };
  while (std::getline(file, text)) {
    ++reader.line;
    if (!text.empty() && text.back() == '\r') text.pop_back();
    if (text.empty()) continue;
    if (text.front() == '#') {
      if (const auto at = text.find_first_not_of("# \t"); reader.header && at != std::string::npos)
        comment = text.substr(at);
      continue;
    }
    if (reader.header) {
      if (text.compare(0, 4, "sep=") == 0) continue;  // a word to Excel
      const bool numbers = all_numbers(text);
      std::string names = numbers ? comment : text;
      separator = separator_of(names);
      if (numbers && (names.empty() || all_numbers(names) ||
                      fields_of(names, separator).size() < fields_of(text, separator_of(text)).size()))
        throw Error(reader.place() +
                    "the first line holds numbers: a header line that names the columns is expected "
                    "(t,q1,...,dq1,...,tau1,...)");
      csv_set_delim(parser.get(), static_cast<unsigned char>(separator));
      if (numbers) {
        const char of_names = separator;
        parse(names);
        separator = separator_of(text);
        if (of_names != separator) csv_set_delim(parser.get(), static_cast<unsigned char>(separator));
        parse(text);
        continue;
      }
    }
    // A separator at the end makes a field too many.
    if (separator != ' ' && !reader.header && text.back() == separator) {
      const auto count = static_cast<std::size_t>(std::count(text.begin(), text.end(), separator));
      if (count == reader.columns.size()) text.pop_back();
    }
    parse(text);
    // Growing by halves, columns of a log of hours would take up twice their size.
    constexpr std::size_t rows_for_estimate = 4096;
    if (reader.table.lines.size() == rows_for_estimate) reader.reserve(file, size);
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
