// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>

#include "dynid/base/error.hpp"
#include "dynid/signal/log.hpp"

namespace dynid {
namespace {

constexpr int joints = 2, rows = 40;
constexpr double step = 0.01;

/// Values that every dialect writes with the same decimals, so that reading gives the same doubles.
double value(int column, int row) {
  return std::round(1e6 * std::sin(0.3 * column + 0.21 * row * (1 + column % 3))) / 1e6;
}

struct Dialect {
  std::string name;
  std::vector<std::string> header;  ///< t, q, dq, tau of two joints; empty: the canonical one
  std::string separator = ",";
  char point = '.';
  std::string before, line_end = "\n", row_end, quote, header_mark;
  LogOptions options;
  std::string time_format = "s";   ///< s, ms, us, ns
  std::vector<std::string> extra;  ///< further columns at the end: `name=text`
};

std::string number(double x, char point) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6f", x);
  std::string s = text;
  if (const auto at = s.find('.'); at != std::string::npos) s[at] = point;
  return s;
}

std::string written(const Dialect& d) {
  std::vector<std::string> names = d.header;
  if (names.empty()) names = {"t", "q1", "q2", "dq1", "dq2", "tau1", "tau2"};
  std::string text = d.before + d.header_mark;
  std::vector<std::string> extra_names, extra_values;
  for (const std::string& e : d.extra) {
    extra_names.push_back(e.substr(0, e.find('=')));
    extra_values.push_back(e.substr(e.find('=') + 1));
  }
  const auto join = [&](const std::vector<std::string>& parts) {
    for (std::size_t k = 0; k < parts.size(); ++k)
      text += (k ? d.separator : "") + d.quote + parts[k] + d.quote;
    text += d.row_end + d.line_end;
  };
  std::vector<std::string> all = names;
  all.insert(all.end(), extra_names.begin(), extra_names.end());
  join(all);
  for (int i = 0; i < rows; ++i) {
    std::vector<std::string> parts;
    const long long ns = 10000000LL * i;
    if (d.time_format == "s")
      parts.push_back(number(step * i, d.point));
    else if (d.time_format == "ns")
      parts.push_back(std::to_string(1700000000000000000LL + ns));
    else if (d.time_format == "us")
      parts.push_back(std::to_string(1700000000000000LL + ns / 1000));
    else if (d.time_format == "ms")
      parts.push_back(std::to_string(1700000000000LL + ns / 1000000));
    if (d.time_format == "none") parts.clear();
    for (int k = 1; k < 7; ++k) parts.push_back(number(value(k, i), d.point));
    parts.insert(parts.end(), extra_values.begin(), extra_values.end());
    join(parts);
  }
  return text;
}

class File {
 public:
  explicit File(const std::string& text, const std::string& extension = ".csv")
      : path_(::testing::TempDir() + "dynid_dialect_" + std::to_string(::getpid()) + extension) {
    std::ofstream(path_, std::ios::binary) << text;
  }
  ~File() { std::filesystem::remove(path_); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

LogOptions two_joints() {
  LogOptions options;
  options.joints = joints;
  return options;
}

std::vector<Dialect> dialects() {
  std::vector<Dialect> list;
  const auto add = [&](const std::string& name, std::vector<std::string> header = {}) -> Dialect& {
    Dialect d;
    d.name = name;
    d.header = std::move(header);
    d.options = two_joints();
    list.push_back(d);
    return list.back();
  };
  add("Canonical");
  add("Semicolons").separator = ";";
  add("Tabs").separator = "\t";
  add("Blanks").separator = " ";
  add("RunsOfBlanks").separator = "   ";
  add("CommasAndBlanks").separator = ", ";
  {
    Dialect& d = add("DecimalComma");
    d.separator = ";";
    d.point = ',';
  }
  {
    Dialect& d = add("DecimalCommaWithTabs");
    d.separator = "\t";
    d.point = ',';
  }
  {
    Dialect& d = add("QuotedDecimalComma");
    d.point = ',';
    d.quote = "\"";
  }
  add("ByteOrderMark").before = "\xEF\xBB\xBF";
  add("CarriageReturns").line_end = "\r\n";
  add("Quotes").quote = "\"";
  add("TrailingSeparator").row_end = ",";
  add("Comments").before = "# a robot, at noon\n\n# another line\n";
  add("HeaderAsComment").header_mark = "# ";
  {
    Dialect& d = add("HeaderAsCommentWithBlanks");
    d.header_mark = "# ";
    d.separator = " ";
  }
  add("ExcelSeparatorLine").before = "sep=,\n";
  add("UpperCase", {"T", "Q1", "Q2", "DQ1", "DQ2", "TAU1", "TAU2"});
  add("Underscores", {"time", "q_1", "q_2", "dq_1", "dq_2", "tau_1", "tau_2"});
  add("FromZero", {"t", "q0", "q1", "dq0", "dq1", "tau0", "tau1"});
  add("Brackets", {"t", "q[0]", "q[1]", "dq[0]", "dq[1]", "tau[0]", "tau[1]"});
  add("QdAndEffort", {"t", "q1", "q2", "qd1", "qd2", "effort1", "effort2"});
  add("Words", {"timestamp", "position_1", "position_2", "velocity_1", "velocity_2", "torque_1", "torque_2"});
  add("JointNumberFirst",
      {"t", "joint1_pos", "joint2_pos", "joint1_vel", "joint2_vel", "joint1_eff", "joint2_eff"});
  add("ShortJointNumberFirst", {"t", "j1_pos", "j2_pos", "j1_vel", "j2_vel", "j1_torque", "j2_torque"});
  add("JointNumberLast",
      {"t", "pos_joint1", "pos_joint2", "vel_joint1", "vel_joint2", "eff_joint1", "eff_joint2"});
  add("JointNames",
      {"t", "shoulder_pos", "elbow_pos", "shoulder_vel", "elbow_vel", "shoulder_eff", "elbow_eff"})
      .options.joint_names = {"shoulder", "elbow"};
  add("WordBeforeJointName", {"t", "position_shoulder", "position_elbow", "velocity_shoulder",
                              "velocity_elbow", "effort_shoulder", "effort_elbow"})
      .options.joint_names = {"shoulder", "elbow"};
  add("PlotJuggler", {"__time", "/joint_states/panda_joint1/position", "/joint_states/panda_joint2/position",
                      "/joint_states/panda_joint1/velocity", "/joint_states/panda_joint2/velocity",
                      "/joint_states/panda_joint1/effort", "/joint_states/panda_joint2/effort"});
  {
    Dialect& d = add("PlotJugglerWithFingers",
                     {"__time", "/joint_states/panda_joint1/position", "/joint_states/panda_joint2/position",
                      "/joint_states/panda_joint1/velocity", "/joint_states/panda_joint2/velocity",
                      "/joint_states/panda_joint1/effort", "/joint_states/panda_joint2/effort"});
    d.options.joint_names = {"panda_joint1", "panda_joint2"};
    d.extra = {"/joint_states/panda_finger_joint1/position=0.04",
               "/joint_states/panda_finger_joint2/position=0.04"};
  }
  {
    Dialect& d = add("RostopicEcho", {"%time", "field.position0", "field.position1", "field.velocity0",
                                      "field.velocity1", "field.effort0", "field.effort1"});
    d.time_format = "ns";
    d.extra = {"field.header.seq=7", "field.header.frame_id=base", "field.name0=panda_joint1"};
  }
  add("Rtde", {"timestamp", "actual_q_0", "actual_q_1", "actual_qd_0", "actual_qd_1",
               "actual_current_as_torque_0", "actual_current_as_torque_1"})
      .separator = " ";
  {
    Dialect& d =
        add("RtdeWithTargets", {"timestamp", "actual_q_0", "actual_q_1", "actual_qd_0", "actual_qd_1",
                                "actual_current_as_torque_0", "actual_current_as_torque_1"});
    d.separator = " ";
    d.extra = {"target_q_0=0.1",    "target_q_1=0.2",     "target_moment_0=1",
               "target_moment_1=2", "actual_current_0=1", "actual_current_1=1"};
  }
  add("Microseconds").time_format = "us";
  add("Milliseconds").time_format = "ms";
  {
    Dialect& d =
        add("NamedByPattern", {"when", "enc.a0", "enc.a1", "rate a0", "rate a1", "load-0-x", "load-1-x"});
    d.options.columns = {{"t", "when"}, {"q", "enc.a#"}, {"dq", "rate a{}"}, {"tau", "load-#-x"}};
  }
  {
    Dialect& d =
        add("NamedByPatternAndJoint", {"t", "p:left", "p:right", "v:left", "v:right", "e:left", "e:right"});
    d.options.joint_names = {"left", "right"};
    d.options.columns = {{"q", "p:#"}, {"dq", "v:#"}, {"tau", "e:#"}};
  }
  {
    Dialect& d = add("WithoutTime", {"q1", "q2", "dq1", "dq2", "tau1", "tau2"});
    d.time_format = "none";
    d.options.rate = 100.0;
  }
  add("FurtherColumnsAndText").extra = {"note=ok", "extra=3"};
  add("RadiansSaid",
      {"t [s]", "q1 [rad]", "q2 [rad]", "dq1 [rad/s]", "dq2 [rad/s]", "tau1 [Nm]", "tau2 [Nm]"});
  return list;
}

void PrintTo(const Dialect& dialect, std::ostream* out) { *out << dialect.name; }

class Dialects : public ::testing::TestWithParam<Dialect> {};

TEST_P(Dialects, GivesTheSameLog) {
  Dialect canonical;
  const File plain(written(canonical));
  const Log expected = read_log(plain.path(), two_joints());
  const Dialect& d = GetParam();
  const File file(written(d), ".txt");
  const Log log = read_log(file.path(), d.options);
  EXPECT_EQ(log.q, expected.q);
  EXPECT_EQ(log.dq, expected.dq);
  EXPECT_EQ(log.tau, expected.tau);
  ASSERT_EQ(log.t.size(), expected.t.size());
  if (d.time_format == "s") {
    EXPECT_EQ(log.t, expected.t);
  } else {
    EXPECT_LT((log.t - expected.t).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_FALSE(log.notes.empty()) << "another unit of time, or none, is said";
  }
  EXPECT_EQ(log.columns.at("q").size(), 2u);
  EXPECT_EQ(log.columns.at("tau").size(), 2u);
}
INSTANTIATE_TEST_SUITE_P(Log, Dialects, ::testing::ValuesIn(dialects()),
                         [](const auto& parameter) { return parameter.param.name; });

// ------------------------------------------------------------------------------------------ refused, in one
// line

struct Refusal {
  std::string name, text;
  std::vector<std::string> parts;  ///< of the message: cause and remedy
  std::string extension = ".csv";
  int robot = 2;
};

std::vector<Refusal> refusals() {
  const std::string row = "0,1,1,1,1,1,1\n0.1,1,1,1,1,1,1\n", head = "t,q1,q2,dq1,dq2,tau1,tau2\n";
  return {
      {"Ros2Bag",
       std::string("SQLite format 3\0rest", 20),
       {"ROS 2 bag (sqlite3)", "Python package"},
       ".db3"},
      {"Mcap", std::string("\x89MCAP0\r\nxxxx"), {"MCAP", "Python package"}, ".mcap"},
      {"RosBag", "#ROSBAG V2.0\n", {"ROS 1 bag"}},
      {"Parquet", "PAR1xxxx", {"parquet", "Python package"}},
      {"Npz", std::string("PK\x03\x04xxxx"), {"NumPy arrays (.npz)", "Python package"}, ".npz"},
      {"Zip", std::string("PK\x03\x04xxxx"), {"zip archive", "unpack"}, ".zip"},
      {"Excel", std::string("PK\x03\x04xxxx"), {"Excel", "save it as CSV"}, ".xlsx"},
      {"Npy", std::string("\x93NUMPY\x01"), {"NumPy array (.npy)"}},
      {"Mat", "MATLAB 5.0 MAT-file", {"MATLAB"}},
      {"Hdf5", std::string("\x89HDF\r\n\x1a\n"), {"HDF5"}},
      {"Gzip", std::string("\x1f\x8b\x08"), {"gzip", "gunzip"}},
      {"Bzip2", "BZh91AY", {"bzip2"}},
      {"Zstd", std::string("\x28\xb5\x2f\xfd"), {"zstd"}},
      {"Utf16", std::string("\xff\xfet\0,\0", 6), {"UTF-16", "UTF-8"}},
      {"Urdf", "<?xml version=\"1.0\"?><robot/>", {"XML"}},
      {"Json", "{\"q1\": [1]}", {"JSON"}},
      {"Binary", std::string("ab\0\1\2", 5), {"binary file"}},
      {"Empty", "", {"empty", "header line"}},
      {"NoHeader", row, {"first line holds numbers", "header line"}},
      {"NoRows", head, {"no row of numbers"}},
      {"SevenForSix",
       "t,q0,q1,q2\n0,1,1,1\n",
       {"the log has 3 joints (q0..q2), the robot has 2", "q2 would be left over"}},
      {"OneForTwo", "t,q1,dq1,tau1\n0,1,1,1\n", {"the log has 1 joints", "the robot has 2"}},
      {"TextInAColumn", head + "0,1,x,1,1,1,1\n", {":2: column q2: 'x' is not a number"}},
      {"MostlyHoles",
       head + "0,1,1,1,1,1,1\n1,nan,1,1,1,1,1\n2,nan,1,1,1,1,1\n",
       {":3: column q1", "at most a tenth"}},
      {"TimeBack", head + "1,1,1,1,1,1,1\n0.5,1,1,1,1,1,1\n", {":3: column t: time goes back"}},
      {"NoTime", "q1,q2,dq1,dq2,tau1,tau2\n1,1,1,1,1,1\n", {"column t is missing", "--rate"}},
      {"NoTorque", "t,q1,q2,dq1,dq2\n0,1,1,1,1\n", {"column tau1 is missing"}},
      {"CurrentsOnly",
       "t,q1,q2,dq1,dq2,actual_current_0,actual_current_1\n0,1,1,1,1,1,1\n",
       {"column tau1 is missing", "actual_current_0", "torque_is_current"}},
      {"NothingKnown", "a,b,c\n1,2,3\n", {"column q1 is missing", "columns: a, b, c", "--columns"}},
      {"OneMissing", "t,q1,q2,dq1,tau1,tau2\n0,1,1,1,1,1\n", {"column dq2 is missing"}},
      {"TwoForOne",
       "t,q1,q_1,q2,dq1,dq2,tau1,tau2\n0,1,1,1,1,1,1,1\n",
       {"q1 and q_1 both look like q1", "--columns"}},
      {"Twice", "t,q1,q1,q2,dq1,dq2,tau1,tau2\n0,1,1,1,1,1,1,1\n", {"q1 and q1 both look like q1"}},
      {"DecimalCommas",
       head + "0,0,1,5,1,5,1,5,1,5,1,5,1,5\n",
       {":2: the row has 14 fields", "decimal commas"}},
      {"CutShort", head + "0,1,1,1,1,1,1\n0.1,1,1\n", {":3: the row has 3 fields, the header names 7"}},
  };
}

void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.name; }

class Refusals : public ::testing::TestWithParam<Refusal> {};

TEST_P(Refusals, NameCauseAndRemedyInOneLine) {
  const Refusal& r = GetParam();
  const File file(r.text, r.extension);
  LogOptions options;
  options.joints = r.robot;
  std::string message = "no error";
  try {
    read_log(file.path(), options);
  } catch (const Error& error) {
    message = error.what();
  }
  for (const std::string& part : r.parts) EXPECT_NE(message.find(part), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  EXPECT_EQ(message.find(file.path()), 0u) << message;
}
INSTANTIATE_TEST_SUITE_P(Log, Refusals, ::testing::ValuesIn(refusals()),
                         [](const auto& parameter) { return parameter.param.name; });

// ------------------------------------------------------------------------------------------------- said

const LogNote* note(const Log& log, const std::string& name) {
  for (const LogNote& n : log.notes)
    if (n.name == name) return &n;
  return nullptr;
}

TEST(LogReading, RowsWithHolesAreLeftOutAndSaid) {
  std::string text = "t,q1,dq1,tau1\n";
  for (int i = 0; i < 30; ++i)
    text += std::to_string(i) + (i == 7 ? ",nan,1,1\n" : i == 9 ? ",1,,1\n" : ",1,1,1\n");
  const File file(text);
  const Log log = read_log(file.path(), 1);
  EXPECT_EQ(log.samples(), 28);
  ASSERT_NE(note(log, "incomplete_rows"), nullptr);
  EXPECT_EQ(note(log, "incomplete_rows")->value, 2.0);
  EXPECT_NE(note(log, "incomplete_rows")->text.find("line 9"), std::string::npos);
}

TEST(LogReading, AWrapIsPutTogetherAndSaid) {
  std::string text = "t,q1,q2,dq1,dq2,tau1,tau2\n";
  const double pi = 3.14159265358979323846;
  for (int i = 0; i < 400; ++i) {
    const double q = 0.02 * i;
    text += std::to_string(0.01 * i) + "," + std::to_string(std::remainder(q, 2.0 * pi)) + "," +
            std::to_string(0.5 * std::sin(q)) + ",2,0,0,0\n";
  }
  const File file(text);
  const Log log = read_log(file.path(), 2);
  for (int i = 0; i < 400; ++i) EXPECT_NEAR(log.q(i, 0), 0.02 * i, 1e-5);
  ASSERT_NE(note(log, "wrapped_position"), nullptr);
  EXPECT_EQ(note(log, "wrapped_position")->joints, std::vector<int>{1});
  LogOptions as_it_stands;
  as_it_stands.unwrap = false;
  EXPECT_LT(read_log(file.path(), as_it_stands).q.maxCoeff(), pi + 1e-6);
}

TEST(LogReading, MillisecondsFromZeroAreSeenByTheVelocity) {
  std::string text = "t,q1,dq1,tau1\n", seconds = text;
  for (int i = 0; i < 200; ++i) {
    const std::string rest =
        "," + std::to_string(std::sin(0.01 * i)) + "," + std::to_string(std::cos(0.01 * i)) + ",0\n";
    text += std::to_string(10 * i) + rest;
    seconds += std::to_string(0.01 * i) + rest;
  }
  const File file(text);
  const Log log = read_log(file.path(), 1);
  EXPECT_NEAR(log.t[100], 1.0, 1e-12);
  ASSERT_NE(note(log, "time_unit"), nullptr);
  EXPECT_NE(note(log, "time_unit")->text.find("look like ms"), std::string::npos);
  const File plain(seconds, ".txt");
  EXPECT_EQ(note(read_log(plain.path(), 1), "time_unit"), nullptr);
}

TEST(LogReading, UnitsInTheHeaderAreConvertedAndSaid) {
  const File file("t (ms),q1 [deg],dq1 [deg/s],tau1 [Nmm]\n0,180,90,2000\n10,180,90,2000\n");
  const Log log = read_log(file.path(), 1);
  EXPECT_NEAR(log.t[1], 0.01, 1e-15);
  EXPECT_NEAR(log.q(0, 0), 3.14159265358979, 1e-12);
  EXPECT_NEAR(log.dq(0, 0), 1.5707963267949, 1e-12);
  EXPECT_NEAR(log.tau(0, 0), 2.0, 1e-12);
  EXPECT_NE(note(log, "header_unit"), nullptr);
}

TEST(LogReading, OptionalColumnsAndThoseUnreadAreKept) {
  const File file("t,q1,dq1,tau1,u1,i1,temp1,theta1,tau_cmd1,ddq1,mood\n0,1,2,3,4,5,6,7,8,9,fine\n");
  const Log log = read_log(file.path(), 1);
  EXPECT_EQ(log.u(0, 0), 4.0);
  EXPECT_EQ(log.i(0, 0), 5.0);
  EXPECT_EQ(log.temp(0, 0), 6.0);
  EXPECT_EQ(log.theta(0, 0), 7.0);
  EXPECT_EQ(log.tau_cmd(0, 0), 8.0);
  EXPECT_EQ(log.ddq(0, 0), 9.0);
  EXPECT_EQ(log.unread, std::vector<std::string>{"mood"});
  EXPECT_EQ(log.columns.at("u"), std::vector<std::string>{"u1"});
  const std::string path = ::testing::TempDir() + "dynid_dialect_back.csv";
  write_log(path, log);
  const Log back = read_log(path, 1);
  std::filesystem::remove(path);
  EXPECT_EQ(back.u, log.u);
  EXPECT_EQ(back.i, log.i);
}

TEST(LogReading, RowNumbersOfPandasAreNotRead) {
  const File file(",t,q1,dq1,tau1\n0,0.5,1,2,3\n1,0.6,1,2,3\n");
  const Log log = read_log(file.path(), 1);
  EXPECT_EQ(log.t[0], 0.5);
  EXPECT_EQ(log.unread, std::vector<std::string>{"index"});
}

TEST(LogReading, ColumnsAreParsedAndMistakesNamed) {
  EXPECT_EQ(parse_columns("q=p_#,t=when"), (std::map<std::string, std::string>{{"q", "p_#"}, {"t", "when"}}));
  for (const std::string text : {"q", "q=", "=x", "q=a,q=b"}) {
    EXPECT_THROW(parse_columns(text), Error) << text;
  }
  const File file("t,q1,dq1,tau1\n0,1,1,1\n");
  LogOptions options;
  options.columns = {{"colour", "x#"}};
  EXPECT_THROW(read_log(file.path(), options), Error);
  options.columns = {{"q", "x#"}};
  EXPECT_THROW(read_log(file.path(), options), Error);
}

}  // namespace
}  // namespace dynid
