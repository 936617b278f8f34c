// SPDX-License-Identifier: Apache-2.0
//
// A law that the library does not have, written here alone as a law is written: reading, writing, prediction
// and the fit take it without knowing it.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <tuple>

#include "dynid/base/error.hpp"
#include "dynid/friction/fit.hpp"
#include "dynid/friction/friction.hpp"
#include "friction/yaml.hpp"

namespace dynid {
namespace {

/// Stribeck friction, the excess over Coulomb friction at low speed: tau_f = fs exp(-|dq / vs|^delta)
/// sign(dq).
struct StribeckFriction {
  double fs = 0.0;              ///< [N m]
  double vs = 1.0;              ///< [rad/s]
  double delta = 2.0;           ///< [1]
  double stribeck_scale = 0.0;  ///< [rad/s] of the sign, as in LinearFriction

  [[maybe_unused]] static constexpr const char* name = "stribeck";
  [[maybe_unused]] static constexpr const char* equation = "Armstrong-Helouvry 1994";
  [[maybe_unused]] static constexpr const char* formula = "fs exp(-|dq / vs|^delta) sign(dq)";
  static constexpr bool all_or_none = true;

  static constexpr auto parameters() noexcept {
    using P = FrictionParameter<StribeckFriction>;
    return std::array<P, 4>{P{"fs", "fs", &StribeckFriction::fs},
                            P{"vs", "vs", &StribeckFriction::vs, FrictionRole::nonlinear, 1, 0.01, 1.0,
                              FrictionSpacing::geometric, 15},
                            P{"delta", "delta", &StribeckFriction::delta, FrictionRole::nonlinear, 0, 0.5,
                              3.0, FrictionSpacing::geometric, 6},
                            P{"stribeck_scale", "", &StribeckFriction::stribeck_scale, FrictionRole::given}};
  }

  double part(double dq) const noexcept { return std::exp(-std::pow(std::abs(dq) / vs, delta)); }
  double torque(double dq) const noexcept { return fs * part(dq) * smooth_sign(dq, stribeck_scale); }
  double slope(double dq) const noexcept {
    if (dq == 0.0) return 0.0;
    const double x = std::abs(dq) / vs, sign = smooth_sign(dq, stribeck_scale);
    const double of_part = -delta * std::pow(x, delta) / dq * part(dq);
    const double of_sign = stribeck_scale > 0.0 ? (1.0 - sign * sign) / stribeck_scale : 0.0;
    return fs * (of_part * sign + part(dq) * of_sign);
  }
  Eigen::RowVector3d regressor(double dq) const noexcept {
    const double x = std::abs(dq) / vs, unit = part(dq) * smooth_sign(dq, stribeck_scale);
    const double power = x > 0.0 ? std::pow(x, delta) : 0.0;
    return {unit, fs * unit * power * delta / vs, x > 0.0 ? -fs * unit * power * std::log(x) : 0.0};
  }
};

/// As JointFriction is made: a member and a place in laws() a law.
struct Friction {
  LinearFriction linear;
  SigmoidFriction sigmoid;
  StribeckFriction stribeck;
  constexpr auto laws() noexcept { return std::tie(linear, sigmoid, stribeck); }
  constexpr auto laws() const noexcept { return std::tie(linear, sigmoid, stribeck); }
};

double torque(const Friction& f, double dq) {
  return std::apply([dq](const auto&... law) { return (law.torque(dq) + ...); }, f.laws());
}

constexpr double scale = 0.01;

FrictionSamples samples(const Friction& truth, double noise, unsigned seed, int count = 4000) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  FrictionSamples s{Eigen::VectorXd(count), Eigen::VectorXd(count), {}, {}};
  for (int i = 0; i < count; ++i) {
    s.dq[i] = 1.5 * std::sin(0.013 * i) + 0.2 * std::sin(0.11 * i);
    s.difference[i] = torque(truth, s.dq[i]) + noise * normal(random);
  }
  return s;
}

Friction truth() {
  Friction f;
  f.linear = {0.4, 1.2, -0.1, scale};
  f.stribeck = {0.7, 0.15, 1.6, scale};
  return f;
}

Friction given() {
  Friction f;
  f.linear.velocity_scale = f.stribeck.stribeck_scale = scale;
  return f;
}

std::vector<FrictionUnknown> unknowns() {
  std::vector<FrictionUnknown> all = unknowns_of<LinearFriction>();
  for (const FrictionUnknown& unknown : unknowns_of<StribeckFriction>()) all.push_back(unknown);
  return all;
}

TEST(NewLaw, ItsDerivativesMatchDifferences) {
  const StribeckFriction f = truth().stribeck;
  const double h = 1e-6;
  for (double dq : {-0.8, -0.1, 0.03, 0.2}) {
    EXPECT_NEAR(friction_slope(f, dq), (f.torque(dq + h) - f.torque(dq - h)) / (2 * h), 1e-7);
    const Eigen::RowVector3d row = friction_regressor(f, dq);
    Eigen::Index k = 0;
    for (const auto& p : StribeckFriction::parameters()) {
      if (p.role == FrictionRole::given) continue;
      StribeckFriction more = f, less = f;
      more.*p.value += h, less.*p.value -= h;
      EXPECT_NEAR(row[k++], (more.torque(dq) - less.torque(dq)) / (2 * h), 1e-7) << p.key << " at " << dq;
    }
  }
}

TEST(NewLaw, IsFittedTogetherWithTheOthers) {
  const Friction f = truth();
  const auto fit = fit_friction(samples(f, 0.0, 1), given(), unknowns());
  EXPECT_NEAR(fit.friction.linear.viscous, f.linear.viscous, 1e-6);
  EXPECT_NEAR(fit.friction.linear.coulomb, f.linear.coulomb, 1e-6);
  EXPECT_NEAR(fit.friction.linear.offset, f.linear.offset, 1e-6);
  EXPECT_NEAR(fit.friction.stribeck.fs, f.stribeck.fs, 1e-6);
  EXPECT_NEAR(fit.friction.stribeck.vs, f.stribeck.vs, 1e-6);
  EXPECT_NEAR(fit.friction.stribeck.delta, f.stribeck.delta, 1e-5);
  EXPECT_EQ(fit.friction.sigmoid.phi1, 0.0);  // no unknown: as given
}

// Errors of the estimates are as large as the information matrix says.
TEST(NewLaw, TheInformationSaysHowSureTheFitIs) {
  const Friction f = truth();
  constexpr double noise = 0.05;
  constexpr int trials = 30;
  Eigen::VectorXd expected(6), squares = Eigen::VectorXd::Zero(6);
  expected << f.linear.viscous, f.linear.coulomb, f.linear.offset, f.stribeck.fs, f.stribeck.vs,
      f.stribeck.delta;
  for (unsigned seed = 0; seed < trials; ++seed) {
    const auto fit = fit_friction(samples(f, noise, seed), given(), unknowns());
    Eigen::VectorXd found(6);
    found << fit.friction.linear.viscous, fit.friction.linear.coulomb, fit.friction.linear.offset,
        fit.friction.stribeck.fs, fit.friction.stribeck.vs, fit.friction.stribeck.delta;
    const Eigen::MatrixXd covariance = noise * noise * fit.information.inverse();
    squares += ((found - expected).array().square() / covariance.diagonal().array()).matrix();
    EXPECT_NEAR(fit.sum_squares / 4000.0, noise * noise, 5.0 * noise * noise * std::sqrt(2.0 / 4000.0))
        << seed;
  }
  // Chi-square over 30 trials has a relative standard deviation of 0.26.
  for (Eigen::Index k = 0; k < 6; ++k) EXPECT_NEAR(squares[k] / trials, 1.0, 0.9) << "unknown " << k;
}

TEST(NewLaw, LimitsAreKept) {
  const auto fit =
      fit_friction(samples(truth(), 0.01, 3), given(),
                   {{"viscous"}, {"coulomb"}, {"offset"}, {"fs"}, {"vs", 0.3, 0.5}, {"delta", 1.0, 1.2}});
  EXPECT_EQ(fit.friction.stribeck.vs, 0.3);
  EXPECT_GE(fit.friction.stribeck.delta, 1.0);
  EXPECT_LE(fit.friction.stribeck.delta, 1.2);
}

TEST(NewLaw, SamplesOfNoWeightDoNotCount) {
  FrictionSamples s = samples(truth(), 0.02, 4);
  const Eigen::Index half = s.dq.size() / 2;
  const FrictionSamples first{s.dq.head(half), s.difference.head(half), {}, {}};
  s.weight = Eigen::VectorXd::Ones(s.dq.size());
  s.weight.tail(half).setZero();
  s.difference.tail(half).setConstant(100.0);
  s.dq.tail(half).setConstant(30.0);
  const auto whole = fit_friction(s, given(), unknowns()), part = fit_friction(first, given(), unknowns());
  EXPECT_NEAR(whole.sum_squares, part.sum_squares, 1e-9 * part.sum_squares);
  EXPECT_NEAR(whole.friction.stribeck.vs, part.friction.stribeck.vs, 1e-6);
}

// What was filtered is fitted through the same filter: here a moving average over nine samples.
TEST(NewLaw, FilteredSamplesAreFittedThroughTheirFilter) {
  const Friction f = truth();
  const FrictionSamples raw = samples(f, 0.0, 5);
  constexpr Eigen::Index width = 9;
  const auto filter = [](const Eigen::MatrixXd& x) {
    Eigen::MatrixXd out(x.rows() - width + 1, x.cols());
    for (Eigen::Index i = 0; i < out.rows(); ++i) out.row(i) = x.middleRows(i, width).colwise().mean();
    return out;
  };
  FrictionSamples s{filter(raw.dq), filter(raw.difference), {}, {}};
  s.filtered = [&](int columns, const std::function<Eigen::RowVectorXd(double)>& row) {
    Eigen::MatrixXd rows(raw.dq.size(), columns);
    for (Eigen::Index i = 0; i < raw.dq.size(); ++i) rows.row(i) = row(raw.dq[i]);
    return filter(rows);
  };
  const auto fit = fit_friction(s, given(), unknowns());
  EXPECT_NEAR(fit.friction.stribeck.vs, f.stribeck.vs, 1e-6);
  EXPECT_NEAR(fit.friction.linear.coulomb, f.linear.coulomb, 1e-6);
  s.filtered = nullptr;
  EXPECT_GT(fit_friction(s, given(), unknowns()).sum_squares, 1e3 * fit.sum_squares);
}

detail::YamlItem item(const std::string& text) {
  return detail::YamlItem::document("format: f\n" + text, "f.yaml", "f", "a test").at("friction");
}

TEST(NewLaw, ItsKeysAreReadAndWritten) {
  YAML::Emitter out;
  out << YAML::BeginMap;
  detail::put_friction(out, truth());
  out << YAML::EndMap;
  EXPECT_STREQ(
      out.c_str(),
      "friction: {viscous: 0.4, coulomb: 1.2, offset: -0.1, velocity_scale: 0.01, fs: 0.7, vs: 0.15, delta: "
      "1.6, stribeck_scale: 0.01}");
  const auto again = detail::read_friction<Friction>(item(out.c_str()));
  std::vector<double> read, written;
  for_each_parameter(again, [&](const auto& law, const auto& p) { read.push_back(law.*p.value); });
  for_each_parameter(truth(), [&](const auto& law, const auto& p) { written.push_back(law.*p.value); });
  EXPECT_EQ(read, written);
  const auto refused = [](const std::string& text) -> std::string {
    try {
      detail::read_friction<Friction>(item(text));
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_EQ(refused("friction: {fs: 1, vs: 2, stribeck_scale: 0}"), "f.yaml:2: friction.delta: missing");
  EXPECT_EQ(refused("friction: {ft: 1}"), "f.yaml:2: friction: unknown key 'ft'");
  EXPECT_EQ(refused("friction: {fs: 1, vs: 2, delta: 1, stribeck_scale: -1}"),
            "f.yaml:2: friction.stribeck_scale: expected a number that is not negative");
}

TEST(NewLaw, AKeyThatIsNoParameterIsRefused) {
  EXPECT_THROW(fit_friction(samples(truth(), 0.0, 1), given(), {{"viscosity"}}), Error);
  EXPECT_THROW(fit_friction(samples(truth(), 0.0, 1), given(), {}), Error);
}

}  // namespace
}  // namespace dynid
