// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace dynid::test {

/// x + e d with e^2 = 0: carries one directional derivative, exact to rounding.
struct Dual {
  double x = 0.0, d = 0.0;

  Dual() = default;
  Dual(double value, double derivative = 0.0) : x(value), d(derivative) {}

  Dual operator-() const { return {-x, -d}; }
  Dual& operator+=(const Dual& b) { return *this = *this + b; }
  Dual& operator-=(const Dual& b) { return *this = *this - b; }
  Dual& operator*=(const Dual& b) { return *this = *this * b; }
  friend Dual operator+(const Dual& a, const Dual& b) { return {a.x + b.x, a.d + b.d}; }
  friend Dual operator-(const Dual& a, const Dual& b) { return {a.x - b.x, a.d - b.d}; }
  friend Dual operator*(const Dual& a, const Dual& b) { return {a.x * b.x, a.x * b.d + a.d * b.x}; }
  friend Dual operator/(const Dual& a, const Dual& b) { return {a.x / b.x, (a.d - a.x / b.x * b.d) / b.x}; }
  friend Dual sin(const Dual& a) { return {std::sin(a.x), std::cos(a.x) * a.d}; }
  friend Dual cos(const Dual& a) { return {std::cos(a.x), -std::sin(a.x) * a.d}; }
};

}  // namespace dynid::test

template <>
struct Eigen::NumTraits<dynid::test::Dual> : Eigen::GenericNumTraits<double> {
  using Real = dynid::test::Dual;
  using NonInteger = dynid::test::Dual;
  using Nested = dynid::test::Dual;
  using Literal = double;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 2,
    AddCost = 2,
    MulCost = 4
  };
};
