// SPDX-License-Identifier: BSD-3-Clause
#include "learning/colored_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "support/allocation_counter.hpp"

namespace trifinger::learning {
namespace {

constexpr std::size_t kLength = 512;
constexpr std::size_t kEpisodes = 200;

// The mean power of the noise at `cycles` cycles in kLength actions.
double power(double color, std::size_t cycles) {
  ColoredNoise noise(1);
  double sum = 0.0;
  for (std::size_t episode = 0; episode < kEpisodes; ++episode) {
    noise.begin(1, episode);
    std::complex<double> part = 0.0;
    for (std::size_t t = 0; t < kLength; ++t) {
      noise.advance(color);
      // A window, because the slow parts are not periodic.
      const double phase = 2.0 * std::numbers::pi * static_cast<double>(t) / kLength;
      part += (1.0 - std::cos(phase)) * noise[0] *
              std::polar(1.0, -phase * static_cast<double>(cycles));
    }
    sum += std::norm(part);
  }
  return sum / kEpisodes;
}

TEST(ColoredNoise, ItsPowerFallsWithTheFrequencyAsItsColorSays) {
  // Over four octaves, from a fiftieth of the rate of the actions to a third.
  const auto slope = [](double color) {
    return std::log2(power(color, 10) / power(color, 160)) / 4.0;
  };
  EXPECT_NEAR(slope(0.0), 0.0, 0.15);
  EXPECT_NEAR(slope(1.0), 1.0, 0.15);
  EXPECT_NEAR(slope(2.0), 1.7, 0.25);
}

TEST(ColoredNoise, HasAStandardDeviationOfOneFromItsFirstNumberOn) {
  for (const double color : {0.0, 0.5, 1.0, 2.0}) {
    ColoredNoise noise(3);
    for (const int actions : {1, 40}) {
      double sum = 0.0;
      double squares = 0.0;
      constexpr int kCount = 4000;
      for (int episode = 0; episode < kCount; ++episode) {
        noise.begin(7, static_cast<std::uint64_t>(episode));
        for (int i = 0; i < actions; ++i) noise.advance(color);
        sum += noise[2];
        squares += noise[2] * noise[2];
      }
      EXPECT_NEAR(sum / kCount, 0.0, 0.06);
      EXPECT_NEAR(squares / kCount, 1.0, 0.1);
    }
  }
}

TEST(ColoredNoise, IsTheSameForTheSameEpisodeAndAllocatesNothing) {
  ColoredNoise noise(2);
  ColoredNoise other(2);
  noise.advance(1.0);
  const test::AllocationCounter counter;
  noise.begin(3, 4);
  other.begin(3, 4);
  for (int i = 0; i < 50; ++i) {
    noise.advance(1.0);
    other.advance(1.0);
    EXPECT_EQ(noise[0], other[0]);
    EXPECT_NE(noise[0], noise[1]);
  }
  EXPECT_EQ(counter.count(), 0U);
  other.begin(3, 5);
  other.advance(1.0);
  EXPECT_NE(noise[0], other[0]);
}

}  // namespace
}  // namespace trifinger::learning
