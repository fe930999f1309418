// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/knot_spline.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "random_grasps.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using test::Random;
using trifinger::test::AllocationCounter;
using Values = std::array<double, 2>;

constexpr std::array kKinds{SplineKind::kConstant, SplineKind::kLinear, SplineKind::kCubic};
constexpr Seconds kInterval{0.1};
constexpr Seconds kBegin{5};
constexpr int kKnots = 6;

KnotSpline random_spline(SplineKind kind, Random& random) {
  KnotSpline spline(kind, kKnots, 2, kInterval, kBegin);
  for (double& value : spline.values()) value = random.between(-1, 1);
  return spline;
}

Values value_at(const KnotSpline& spline, Seconds time) {
  Values value{};
  spline.at(time, value);
  return value;
}

Values rate_at(const KnotSpline& spline, Seconds time) {
  Values value{};
  Values rate{};
  spline.at(time, value, rate);
  return rate;
}

TEST(KnotSpline, GoesThroughItsKnots) {
  Random random(1);
  for (const SplineKind kind : kKinds) {
    const KnotSpline spline = random_spline(kind, random);
    for (int i = 0; i < kKnots; ++i) {
      // A constant spline jumps at its knots.
      const Values value = value_at(spline, kBegin + i * kInterval + Seconds(1e-12));
      for (std::size_t k = 0; k < 2; ++k) EXPECT_NEAR(value[k], spline.knot(i)[k], 1e-9);
    }
  }
}

TEST(KnotSpline, RestsOutsideItsKnots) {
  Random random(2);
  for (const SplineKind kind : kKinds) {
    const KnotSpline spline = random_spline(kind, random);
    for (const double distance : {0.0, 0.01, 1e9, std::numeric_limits<double>::infinity()}) {
      const Seconds before = spline.begin() - Seconds(distance);
      const Seconds after = spline.end() + Seconds(distance);
      for (std::size_t k = 0; k < 2; ++k) {
        EXPECT_EQ(value_at(spline, before)[k], spline.knot(0)[k]);
        EXPECT_EQ(value_at(spline, after)[k], spline.knot(kKnots - 1)[k]);
        EXPECT_EQ(rate_at(spline, before)[k], 0.0);
        EXPECT_EQ(rate_at(spline, after)[k], 0.0);
      }
    }
  }
}

TEST(KnotSpline, RateIsTheDerivative) {
  Random random(3);
  for (const SplineKind kind : kKinds) {
    const KnotSpline spline = random_spline(kind, random);
    for (int i = 0; i < 100; ++i) {
      const Seconds time = kBegin + random.between(0.001, 0.499) * Seconds(1);
      if (std::abs(std::remainder((time - kBegin) / kInterval, 1.0)) < 1e-3) continue;
      constexpr Seconds kStep{1e-6};
      const Values after = value_at(spline, time + kStep);
      const Values before = value_at(spline, time - kStep);
      for (std::size_t k = 0; k < 2; ++k)
        EXPECT_NEAR(rate_at(spline, time)[k], (after[k] - before[k]) / (2 * kStep.count()), 1e-6);
    }
  }
}

TEST(KnotSpline, CubicRateIsContinuous) {
  Random random(4);
  const KnotSpline spline = random_spline(SplineKind::kCubic, random);
  for (int i = 1; i + 1 < kKnots; ++i) {
    const Seconds knot = kBegin + i * kInterval;
    for (std::size_t k = 0; k < 2; ++k)
      EXPECT_NEAR(rate_at(spline, knot - Seconds(1e-9))[k],
                  rate_at(spline, knot + Seconds(1e-9))[k], 1e-5);
  }
}

TEST(KnotSpline, RepeatsPolynomialsOfItsOrder) {
  // Constant, linear and quadratic functions, within the knots that have neighbours on both sides.
  for (std::size_t order = 0; order < kKinds.size(); ++order) {
    const auto function = [order](Seconds time) {
      return std::pow((time - Seconds(5.2)).count(), static_cast<double>(order));
    };
    KnotSpline spline(kKinds[order], kKnots, 1, kInterval, kBegin);
    for (int i = 0; i < kKnots; ++i) spline.knot(i)[0] = function(kBegin + i * kInterval);
    for (double t = 0.11; t < 0.39; t += 0.013) {
      std::array<double, 1> value{};
      spline.at(kBegin + Seconds(t), value);
      EXPECT_NEAR(value[0], function(kBegin + Seconds(t)), 1e-12);
    }
  }
}

TEST(KnotSpline, NeitherAllocatesNorNeedsGoodTimes) {
  Random random(5);
  KnotSpline spline = random_spline(SplineKind::kCubic, random);
  const AllocationCounter counter;
  const Values value = value_at(spline, Seconds(std::nan("")));
  spline.move_to(Seconds(1));
  EXPECT_EQ(counter.count(), 0);
  EXPECT_EQ(value[0], spline.knot(0)[0]);
}

TEST(KnotSpline, RefusesWhatIsNoSpline) {
  EXPECT_THROW(KnotSpline(SplineKind::kLinear, 0, 1, kInterval), InvalidArgument);
  EXPECT_THROW(KnotSpline(SplineKind::kLinear, 1, 0, kInterval), InvalidArgument);
  EXPECT_THROW(KnotSpline(SplineKind::kLinear, 1, 1, Seconds(0)), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::control
