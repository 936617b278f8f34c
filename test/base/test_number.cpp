// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <clocale>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>

#include "dynid/base/number.hpp"

namespace dynid {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Doubles of every size and sign, subnormal ones among them.
double any_double(std::mt19937_64& random) {
  double x = 0.0;
  do {
    const std::uint64_t bits = random();
    std::memcpy(&x, &bits, sizeof x);
  } while (!std::isfinite(x));
  return x;
}

std::string printed(const char* format, int precision, double x) {
  char text[512];
  std::snprintf(text, sizeof text, format, precision, x);
  return text;
}

TEST(Number, WhatIsWrittenExactlyIsReadAsTheSameDouble) {
  std::mt19937_64 random(11);
  for (int k = 0; k < 20000; ++k) {
    const double x = any_double(random);
    double again = 0.0;
    ASSERT_TRUE(parse_number(exact_number(x), again)) << exact_number(x);
    ASSERT_EQ(x, again);
  }
}

TEST(Number, RoundedFormsArePrintfsOwn) {
  std::mt19937_64 random(12);
  for (int k = 0; k < 5000; ++k) {
    const double x =
        k % 2 == 0 ? any_double(random) : std::ldexp(double(random() >> 11), -53) * 2000.0 - 1000.0;
    const int digits = 1 + static_cast<int>(random() % 17);
    ASSERT_EQ(short_number(x, digits), printed("%.*g", digits, x));
    ASSERT_EQ(fixed_number(x, digits), printed("%.*f", digits, x));
  }
  EXPECT_EQ(short_number(infinity), "inf");
  EXPECT_EQ(fixed_number(-infinity, 3), "-inf");
  EXPECT_EQ(short_number(-std::nan("")), "nan");
  EXPECT_EQ(exact_number(-std::nan("")), "nan");
}

TEST(Number, NothingButAFiniteNumberIsRead) {
  double value = 7.0;
  for (const char* text : {"", " ", "+", "-", "+-1", "--1", "1 ", " 1", "1,5", "1.5.", "0x10", "nan", "inf",
                           "-inf", "1e999", "1e", "one", "1 kg"})
    EXPECT_FALSE(parse_number(text, value)) << "'" << text << "'";
  EXPECT_EQ(value, 7.0);
  const std::pair<const char*, double> good[] = {{"+1.5", 1.5}, {".5", 0.5}, {"5.", 5.0}, {"-1e-3", -1e-3}};
  for (const auto& [text, expected] : good) {
    EXPECT_TRUE(parse_number(text, value)) << text;
    EXPECT_EQ(value, expected);
  }
}

TEST(Number, RowsOfVectors) {
  const Eigen::Vector3d x(1.0, -0.25, 1e-7);
  EXPECT_EQ(number_row(x), "1  -0.25  1e-07");
  EXPECT_EQ(fixed_row(x, 2, " "), "1.00 -0.25 0.00");
  EXPECT_EQ(number_row(std::vector<double>{}), "");
}

// A program that sets its locale (a plotter, a window) must not change what is written or read.
TEST(Number, TheLocaleIsOfNoInfluence) {
  const std::string before = std::setlocale(LC_ALL, nullptr);
  const char* found = nullptr;
  for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "nl_NL.UTF-8"})
    if (found == nullptr) found = std::setlocale(LC_ALL, name);
  if (found == nullptr) GTEST_SKIP() << "no locale with a decimal comma on this machine";
  double value = 0.0;
  const bool read = parse_number("0.5", value);
  const std::string exact = exact_number(0.5), rounded = short_number(0.5), fixed = fixed_number(0.5, 1);
  std::setlocale(LC_ALL, before.c_str());
  EXPECT_TRUE(read);
  EXPECT_EQ(value, 0.5);
  EXPECT_EQ(exact, "0.5");
  EXPECT_EQ(rounded, "0.5");
  EXPECT_EQ(fixed, "0.5");
}

}  // namespace
}  // namespace dynid
