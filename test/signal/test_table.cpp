// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>

#include "dynid/base/error.hpp"
#include "dynid/signal/log.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {
namespace {

class TableFile {
 public:
  explicit TableFile(const std::string& text)
      : path_(::testing::TempDir() + "dynid_table_" + std::to_string(::getpid()) + ".csv") {
    std::ofstream(path_, std::ios::binary) << text;
  }
  ~TableFile() { std::filesystem::remove(path_); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::string table_error(const std::string& text) {
  const TableFile file(text);
  return error_of([&] { read_table(file.path()); });
}

std::string log_error(const std::string& text, int joints = 0) {
  const TableFile file(text);
  return error_of([&] { read_log(file.path(), joints); });
}

void expect_in(const std::string& part, const std::string& text) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
  EXPECT_EQ(text.find('\n'), std::string::npos) << "more than one line: " << text;
}

TEST(Table, WhatIsWrittenReadsBackBitForBit) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd values(50, 4);
  for (double& x : values.reshaped()) x = normal(random) * std::pow(10.0, 20.0 * normal(random));
  values(0, 0) = 0.1;
  values(1, 0) = -0.0;
  const std::string path = ::testing::TempDir() + "dynid_round_trip.csv";
  write_table(path, {"a", "b", "c", "d"}, values);
  const Table table = read_table(path);
  std::filesystem::remove(path);
  EXPECT_EQ(table.names, (std::vector<std::string>{"a", "b", "c", "d"}));
  EXPECT_EQ(table.values, values);
}

TEST(Table, CommentsBlankLinesSpacesAndCarriageReturnsAreNotData) {
  const TableFile file("# a comment, with, commas\r\nb , a\r\n\r\n 1 , +2.5e0\r\n#1,2\r\n3,4\r\n");
  const Table table = read_table(file.path());
  EXPECT_EQ(table.names, (std::vector<std::string>{"b", "a"}));
  ASSERT_EQ(table.values.rows(), 2);
  EXPECT_EQ(table.values(0, 1), 2.5);
  EXPECT_EQ(table.values(1, 0), 3.0);
  EXPECT_EQ(table.lines, (std::vector<long>{4, 6}));
}

TEST(Table, BadFilesAreNamedByLineAndColumn) {
  expect_in("the file is empty", table_error(""));
  expect_in("the file is empty", table_error("# only a comment\n"));
  expect_in("no row of numbers", table_error("a,b\n"));
  expect_in(":3: column b: 'x1' is not a number", table_error("a,b\n1,2\n3,x1\n"));
  expect_in(":2: column a: nan is not finite", table_error("a,b\nnan,2\n"));
  expect_in(":2: column b: inf is not finite", table_error("a,b\n1,inf\n"));
  expect_in(":2: column b: '1e999' is out of range", table_error("a,b\n1,1e999\n"));
  expect_in(":2: column b: '' is not a number", table_error("a,b\n1,\n"));
  expect_in(":3: the row has 1 fields, the header names 2", table_error("a,b\n1,2\n3"));
  expect_in(":2: the row has 3 fields, the header names 2", table_error("a,b\n1,2,3\n"));
  expect_in(":3: a quotation mark is not closed", table_error("a,b\n1,2\n3,\"4\n5,6\n"));
  expect_in(":2: a quotation mark is not closed", table_error("a,b\n1,\"2"));
  expect_in("the header names column a twice", table_error("a,a\n1,2\n"));
  expect_in("cannot be read", error_of([] { read_table("/no/such/file.csv"); }));
}

TEST(Log, ColumnsInAnyOrderOthersIgnored) {
  const TableFile file("tau1,extra,q1,t,dq1\n5,9,1,0,2\n6,9,2,0.1,3\n");
  const Log log = read_log(file.path(), 1);
  EXPECT_EQ(log.t[1], 0.1);
  EXPECT_EQ(log.q(1, 0), 2.0);
  EXPECT_EQ(log.dq(0, 0), 2.0);
  EXPECT_EQ(log.tau(1, 0), 6.0);
  EXPECT_EQ(log.ddq.size(), 0);
}

TEST(Log, BadLogsAreNamed) {
  expect_in("column dq2 is missing", log_error("t,q1,q2,dq1,tau1,tau2\n0,1,1,1,1,1\n"));
  expect_in("column t is missing", log_error("q1,dq1,tau1\n1,1,1\n"));
  expect_in("column q1 is missing", log_error("t,dq1,tau1\n1,1,1\n"));
  expect_in("columns: t, a b, c;", log_error("t,\"a\nb\",c\n1,1,1\n"));
  expect_in("the log has 1 joints (q1..q1), the robot has 7", log_error("t,q1,dq1,tau1\n0,1,1,1\n", 7));
  expect_in(":4: column t: time goes back from 1 s to 0.5 s",
            log_error("t,q1,dq1,tau1\n0,1,1,1\n1,1,1,1\n0.5,1,1,1\n"));
}

}  // namespace
}  // namespace dynid
