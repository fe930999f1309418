// SPDX-License-Identifier: BSD-3-Clause
#include "control/ballistics.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>

#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/impedance.hpp"

namespace trifinger::control {
namespace {

using Eigen::Vector3d;

struct Flight {
  Vector3d start;
  Vector3d velocity;
  [[nodiscard]] Vector3d at(double t) const {
    return start + t * velocity + 0.5 * t * t * gravity();
  }
};

Flight any_flight(std::mt19937_64& random) {
  std::uniform_real_distribution<double> one(-1.0, 1.0);
  return {.start = {one(random), one(random), 1.0 + one(random)},
          .velocity = {3 * one(random), 3 * one(random), 3 * one(random)}};
}

TEST(BallisticEstimator, FindsAnyFlightFromTwoPositionsOrMore) {
  std::mt19937_64 random(1);
  for (int number = 2; number < 100; ++number) {
    const Flight flight = any_flight(random);
    BallisticEstimator estimator;
    for (int i = 0; i < number; ++i) estimator.add(Seconds(5 + 0.01 * i), flight.at(0.01 * i));
    for (const double t : {-0.1, 0.0, 0.7}) {
      const PointMotion motion = estimator.at(Seconds(5 + t));
      EXPECT_LT((motion.position - flight.at(t)).norm(), 1e-9);
      EXPECT_LT((motion.velocity - flight.velocity - t * gravity()).norm(), 1e-8);
    }
  }
}

TEST(BallisticEstimator, SaysWhenItFallsThroughAHeight) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 50; ++i) {
    const Flight flight = any_flight(random);
    BallisticEstimator estimator;
    for (int k = 0; k < 10; ++k) estimator.add(Seconds(0.01 * k), flight.at(0.01 * k));
    const double top =
        flight.start.z() + (flight.velocity.z() > 0 ? std::pow(flight.velocity.z(), 2) / 19.62 : 0);
    const auto time = estimator.falls_through(flight.start.z() - 0.5);
    ASSERT_TRUE(time);
    EXPECT_NEAR(estimator.at(*time).position.z(), flight.start.z() - 0.5, 1e-9);
    EXPECT_LT(estimator.at(*time).velocity.z(), 0.0);
    if (flight.velocity.z() > 0) {
      EXPECT_FALSE(estimator.falls_through(top + 0.01));
    }
  }
}

TEST(BallisticEstimator, OnePositionBeginsToFallThere) {
  BallisticEstimator estimator;
  estimator.add(Seconds(2), {0.1, 0.2, 1.0});
  EXPECT_EQ(estimator.count(), 1U);
  EXPECT_NEAR((*estimator.falls_through(0.5) - Seconds(2)).count(), std::sqrt(1.0 / 9.81), 1e-12);
  EXPECT_EQ(estimator.at(Seconds(2)).position, Vector3d(0.1, 0.2, 1.0));
}

TEST(BallisticEstimator, ForgetsWhatWasBeforeTheFlight) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 0.001);
  for (int trial = 0; trial < 20; ++trial) {
    // It rests in a hand, then falls.
    BallisticEstimator estimator;
    const Flight flight{.start = {0.01, -0.01, 1.0}, .velocity = Vector3d::Zero()};
    for (int i = -100; i <= 25; ++i) {
      const Vector3d error(noise(random), noise(random), noise(random));
      estimator.add(Seconds(0.01 * i), flight.at(std::max(0.01 * i, 0.0)) + error);
    }
    // In the first 0.1 s it falls by as little as 5 cm; a part of that still fits.
    EXPECT_LT(estimator.span(), Seconds(0.35));
    EXPECT_LT((estimator.at(Seconds(0.32)).position - flight.at(0.32)).norm(), 0.01);
  }
}

TEST(BallisticEstimator, IgnoresWhatIsOldOrNoNumber) {
  const Flight flight{.start = {0, 0, 1}, .velocity = {1, 0, 0}};
  BallisticEstimator estimator;
  estimator.add(Seconds(0.00), flight.at(0.00));
  estimator.add(Seconds(0.01), flight.at(0.01));
  estimator.add(Seconds(0.01), {5, 5, 5});
  estimator.add(Seconds(0.005), {5, 5, 5});
  estimator.add(Seconds(0.02), Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_EQ(estimator.count(), 2U);
  EXPECT_LT((estimator.at(Seconds(0.1)).position - flight.at(0.1)).norm(), 1e-9);
}

TEST(BallisticEstimator, TurnsWithTheWorldAboutTheVertical) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 0.001);
  const Eigen::AngleAxisd turn(2.0, Vector3d::UnitZ());
  const Flight flight = any_flight(random);
  BallisticEstimator here;
  BallisticEstimator there;
  for (int i = 0; i < 20; ++i) {
    const Vector3d seen =
        flight.at(0.01 * i) + Vector3d(noise(random), noise(random), noise(random));
    here.add(Seconds(0.01 * i), seen);
    there.add(Seconds(0.01 * i), turn * seen);
  }
  EXPECT_LT((turn * here.at(Seconds(0.5)).position - there.at(Seconds(0.5)).position).norm(),
            1e-12);
}

TEST(BallisticEstimator, DoesNotAllocate) {
  BallisticEstimator estimator;
  const test::AllocationCounter allocations;
  for (int i = 0; i < 200; ++i) estimator.add(Seconds(0.01 * i), {0.0, 0.0, 0.1 * (i % 7)});
  (void)estimator.falls_through(0.0);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(BallisticEstimator, RefusesATolerance) {
  for (const double tolerance : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(BallisticEstimator{tolerance}, InvalidArgument);
  }
}

}  // namespace
}  // namespace trifinger::control
