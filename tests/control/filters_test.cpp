// SPDX-License-Identifier: BSD-3-Clause
#include "control/filters.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "random_grasps.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using test::Random;

Signal one(double value) { return Signal::Constant(1, value); }

TEST(LowPassFilter, StartsAtTheFirstSample) {
  LowPassFilter filter(10);
  EXPECT_EQ(filter.value().size(), 0);
  EXPECT_EQ(filter.update(one(5), Seconds(0))[0], 5);
  filter.reset();
  EXPECT_EQ(filter.update(one(7), Seconds(0))[0], 7);
}

TEST(LowPassFilter, ForgetsExponentiallyWhateverTheIntervals) {
  Random random(1);
  LowPassFilter filter(3);
  (void)filter.update(one(1), Seconds(0));
  double time = 0;
  for (int i = 0; i < 100; ++i) {
    const double elapsed = random.between(0, 0.01);
    time += elapsed;
    EXPECT_NEAR(filter.update(one(0), Seconds(elapsed))[0],
                std::exp(-2 * std::numbers::pi * 3 * time), 1e-12);
  }
}

TEST(LowPassFilter, LetsHalfThePowerThroughAtItsCutoffFrequency) {
  LowPassFilter filter(10);
  double power = 0;
  constexpr int kPerPeriod = 10'000;
  for (int i = 0; i < 20 * kPerPeriod; ++i) {
    const double phase = 2 * std::numbers::pi * i / kPerPeriod;
    const double out = filter.update(one(std::sin(phase)), Seconds(0.1 / kPerPeriod))[0];
    if (i >= 10 * kPerPeriod) power += out * out / (10 * kPerPeriod);
  }
  EXPECT_NEAR(power / 0.5, 0.5, 1e-3);
}

TEST(LowPassFilter, NeverLeavesTheRangeOfItsSamples) {
  Random random(2);
  LowPassFilter filter(5);
  for (int i = 0; i < 10'000; ++i) {
    const Signal& value = filter.update(random.numbers<9>(1.0), Seconds(random.between(0, 1)));
    EXPECT_LE(value.cwiseAbs().maxCoeff(), 1.0);
  }
}

TEST(Derivative, FindsTheRateOfARampWhateverTheIntervals) {
  Random random(3);
  Derivative derivative(20);
  const Signal rate = random.numbers<9>(5.0);
  double time = 0;
  EXPECT_TRUE(derivative.update(Signal::Zero(9), Seconds(1)).isZero(0.0));
  for (int i = 0; i < 1000; ++i) {
    const double elapsed = random.between(0.0005, 0.0015);
    time += elapsed;
    (void)derivative.update(time * rate, Seconds(elapsed));
  }
  EXPECT_LT((derivative.update(time * rate, Seconds(0)) - rate).norm(), 1e-9);
}

TEST(Derivative, IgnoresASampleWithoutTimeSinceTheOneBefore) {
  Derivative derivative(20);
  (void)derivative.update(one(0), Seconds(0));
  (void)derivative.update(one(1), Seconds(0.1));
  const double before = derivative.update(one(100), Seconds(0))[0];
  EXPECT_TRUE(std::isfinite(before));
  EXPECT_GT(derivative.update(one(2), Seconds(0.1))[0], 0);
  EXPECT_NEAR(derivative.update(one(2), Seconds(10))[0], 0, 1e-9);
}

TEST(Filters, BeginAnewWithAnotherNumberOfValues) {
  LowPassFilter filter(10);
  Derivative derivative(10);
  for (const Eigen::Index size : {2, 9, 3}) {
    const Signal sample = Signal::Constant(size, static_cast<double>(size));
    EXPECT_EQ(filter.update(sample, Seconds(1e-3)), sample);
    EXPECT_EQ(derivative.update(sample, Seconds(1e-3)), Signal::Zero(size));
  }
}

TEST(Filters, RefuseFrequenciesThatMakeNoSense) {
  EXPECT_THROW(LowPassFilter(0), InvalidArgument);
  EXPECT_THROW(LowPassFilter(std::nan("")), InvalidArgument);
  EXPECT_THROW(Derivative(-1), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::control
