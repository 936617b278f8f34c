// SPDX-License-Identifier: Apache-2.0
// Velocity and acceleration from positions whose stamps jitter.
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/chains.hpp"
#include "dynid/estimation/motion_filter.hpp"

namespace dynid::test {
namespace {

using Eigen::Vector2d;

// Whatever the steps, a motion of constant acceleration is followed without error.
TEST(MotionFilter, FollowsConstantAccelerationExactly) {
  for (const double w : {25.0, 100.0, 400.0}) {
    Generator generator(3);
    MotionFilter<2> filter(2, {w, 0.0, 1e-5});
    const Vector2d v0(0.3, -1.0), a(2.0, -0.7);
    const auto at = [&](double t) { return Vector2d(v0 * t + 0.5 * a * t * t); };
    filter.start(Vector2d::Zero(), Vector2d::Zero());
    double t = 0.0;
    while (t < 60.0 / w) {
      const double dt = uniform(generator, 0.0005, 0.003);
      t += dt;
      EXPECT_EQ(filter.elapsed(dt, at(t)), dt);
      filter.update(dt, at(t));
    }
    EXPECT_LT((filter.position() - at(t)).norm(), 1e-9) << w;
    EXPECT_LT((filter.velocity() - v0 - a * t).norm(), 1e-7) << w;
    EXPECT_LT((filter.acceleration() - a).norm(), 1e-4) << w;
  }
}

// Lost samples, stamps up to 0.3 periods late, repeats, velocities through zero: the robot's own clock is
// found again.
TEST(MotionFilter, FindsTheRobotsClockBehindJitteringStamps) {
  constexpr double period = 1e-3;
  Generator generator(5);
  MotionFilter<2> filter(2, {100.0, period, 1e-6});
  const auto q = [](double t) { return Vector2d(0.5 * std::sin(3.0 * t), 0.3 * std::cos(4.1 * t)); };
  const auto dq = [](double t) { return Vector2d(1.5 * std::cos(3.0 * t), -1.23 * std::sin(4.1 * t)); };
  filter.start(q(0.0), dq(0.0));
  double t = 0.0, stamp = 0.0, worst = 0.0;
  int wrong = 0, repeats = 0;
  for (int k = 0; k < 20000; ++k) {
    const double draw = uniform(generator, 0.0, 1.0);
    const int periods = draw < 0.9 ? 1 : draw < 0.98 ? 2 : 6;
    t += periods * period;
    const double next = t + uniform(generator, 0.0, 0.3) * period;
    const double elapsed = filter.elapsed(next - stamp, q(t));
    wrong += std::abs(elapsed - periods * period) > 1e-9;
    filter.update(elapsed, q(t), next - stamp);
    stamp = next;
    if (k % 50 == 0 && filter.velocity().norm() > 0.1) {
      ++repeats;
      EXPECT_EQ(filter.elapsed(0.4 * period, q(t)), 0.0) << k;
    }
    if (k > 200) worst = std::max(worst, (filter.velocity() - dq(t)).norm());
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(repeats, 100);
  // 3 jerk / w^2 at most; stamps that are taken as they are make ten times as much.
  EXPECT_LT(worst, 3.0 * std::hypot(0.5 * 27.0, 0.3 * 4.1 * 4.1 * 4.1) / (100.0 * 100.0));
}

// A velocity of half or a third the true one makes two or three periods of each, which confirm it: the stamps
// must end that.
TEST(MotionFilter, WrongVelocityDoesNotConfirmItself) {
  constexpr double period = 1e-3;
  for (const double bandwidth : {25.0, 50.0, 100.0, 200.0})
    for (const double part : {0.5, 1.0 / 3.0, 2.0}) {
      Generator generator(7);
      MotionFilter<2> filter(2, {bandwidth, period, 1e-6});
      const auto q = [](double t) { return Vector2d(0.5 * std::sin(1.5 * t), 0.3 * std::sin(2.1 * t)); };
      const auto dq = [](double t) { return Vector2d(0.75 * std::cos(1.5 * t), 0.63 * std::cos(2.1 * t)); };
      filter.start(q(0.0), part * dq(0.0));
      double t = 0.0, stamp = 0.0, since = 0.0, counted = 0.0;
      for (int k = 0; k < 5000; ++k) {
        t += period;
        const double next = t + uniform(generator, 0.0, 0.3) * period;
        since += next - stamp;
        stamp = next;
        const double elapsed = filter.elapsed(since, q(t));
        if (!(elapsed > 0.0)) continue;
        filter.update(elapsed, q(t), since);
        counted += elapsed, since = 0.0;
      }
      EXPECT_NEAR(counted, t, 10.0 * period) << bandwidth << " " << part;  // those of the beginning
      EXPECT_LT((filter.velocity() - dq(t)).norm(), 0.05 * dq(t).norm()) << bandwidth << " " << part;
    }
}

// At rest only the stamps speak, each late by 0 to 0.4 ms.
TEST(MotionFilter, CountsStampsAtRest) {
  MotionFilter<2> filter(2, {100.0, 0.002, 1e-5});
  filter.start(Vector2d::Ones(), Vector2d::Zero());
  double was_late = 0.0;
  for (const int periods : {1, 2, 7, 1, 3}) {
    const double late = was_late > 0.0 ? 0.0 : 0.0004, stamped = 0.002 * periods + late - was_late;
    EXPECT_NEAR(filter.elapsed(stamped, Vector2d::Ones()), 0.002 * periods, 1e-12);
    filter.update(0.002 * periods, Vector2d::Ones(), stamped);
    was_late = late;
  }
  EXPECT_EQ(filter.velocity(), Vector2d(Vector2d::Zero()));
}

TEST(MotionFilter, RefusesOptionsOutOfRange) {
  EXPECT_THROW(MotionFilter<2>(2, {0.0, 0.0, 1e-5}), Error);
  EXPECT_THROW(MotionFilter<2>(2, {100.0, -1e-3, 1e-5}), Error);
  EXPECT_THROW(MotionFilter<2>(2, {100.0, 0.0, 0.0}), Error);
  EXPECT_THROW(MotionFilter<2>(2, {INFINITY, 0.0, 1e-5}), Error);
}

}  // namespace
}  // namespace dynid::test
