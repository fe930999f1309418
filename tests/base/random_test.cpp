// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/random.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <set>
#include <type_traits>
#include <vector>

namespace trifinger {
namespace {

static_assert(std::is_trivially_copyable_v<Random> && std::is_aggregate_v<Random>);

constexpr std::int64_t kLowest = std::numeric_limits<std::int64_t>::min();
constexpr std::int64_t kHighest = std::numeric_limits<std::int64_t>::max();

std::vector<double> drawn(std::size_t count, const std::function<double()>& draw) {
  std::vector<double> numbers(count);
  std::ranges::generate(numbers, draw);
  return numbers;
}

// Kolmogorov-Smirnov distance of the numbers from a distribution, times the root of their count:
// below 1.95 in 999 of 1000 cases.
double distance(std::vector<double> numbers, double (*distribution)(double)) {
  std::ranges::sort(numbers);
  const auto count = static_cast<double>(numbers.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double expected = distribution(numbers[i]);
    const auto below = static_cast<double>(i);
    largest = std::max({largest, expected - below / count, (below + 1) / count - expected});
  }
  return largest * std::sqrt(count);
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  double products = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) products += a[i] * b[i];
  return products / static_cast<double>(a.size());
}

// Known answers published with Random123 1.14 (kat_vectors).
TEST(Philox, GivesTheKnownAnswersOfItsAuthors) {
  using Numbers = std::array<std::uint32_t, 4>;
  constexpr std::uint32_t kOnes = 0xffffffff;
  EXPECT_EQ(philox4x32_10({0, 0, 0, 0}, {0, 0}),
            (Numbers{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox4x32_10({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
            (Numbers{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(
      philox4x32_10({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
      (Numbers{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

// The expected numbers come from an independent program in Python. Its normal numbers are within 2
// units of the last place of values computed with 60 decimals.
TEST(Random, IsTheSameOnEveryMachineBitForBit) {
  Random random{.seed = (std::uint64_t{1} << 40U) + 7, .episode = (std::uint64_t{1} << 33U) + 5};
  for (const double expected : {0x1.7080f7d016898p-2, 0x1.30cbaa21fbe68p-1, 0x1.2073dad37cfd0p-3}) {
    EXPECT_EQ(random.uniform(-1, 3), expected);
  }
  for (const double expected : {-0x1.074e6ff1ce65dp-2, -0x1.59f175d322525p-1, 0x1.d510916b3f1d0p+0,
                                -0x1.2ae1a10c5974ap-2}) {
    EXPECT_EQ(random.normal(), expected);
  }
  for (const std::int64_t expected : {283515721847766380, -8787072652821364182}) {
    EXPECT_EQ(random.integer(kLowest, kHighest), expected);
  }
  for (const std::int64_t expected : {0, 3, 4, 4}) EXPECT_EQ(random.integer(0, 6), expected);
  EXPECT_EQ(random.count, 13);
}

TEST(Random, GoesOnFromACopyAsTheOriginalDoes) {
  Random random{.seed = 5, .episode = 6};
  for (int i = 0; i < 1000; ++i) {
    Random copy = random;
    EXPECT_EQ(copy, random);
    EXPECT_EQ(copy.normal(), random.normal());
    EXPECT_EQ(copy.integer(0, 100), random.integer(0, 100));
    EXPECT_EQ(copy.uniform(0, 1), random.uniform(0, 1));
    EXPECT_EQ(copy, random);
  }
}

TEST(Random, SpreadsUniformly) {
  Random random{.seed = 1};
  const auto numbers = drawn(200'000, [&] { return random.uniform(2, 5); });
  EXPECT_GE(std::ranges::min(numbers), 2.0);
  EXPECT_LT(std::ranges::max(numbers), 5.0);
  EXPECT_LT(distance(numbers, [](double x) { return (x - 2) / 3; }), 1.95);
}

TEST(Random, SpreadsNormally) {
  Random random{.seed = 2};
  const auto numbers = drawn(200'000, [&] { return random.normal(); });
  EXPECT_LT(distance(numbers, [](double x) { return std::erfc(-x / std::numbers::sqrt2) / 2; }),
            1.95);
  // The distance says little about the tails: 540 of 200'000 numbers are expected beyond 3.
  const auto far = std::ranges::count_if(numbers, [](double x) { return std::abs(x) > 3; });
  EXPECT_NEAR(static_cast<double>(far), 540, 4 * std::sqrt(540));
}

TEST(Random, NeverReachesTheUpperBoundHoweverNarrowTheRange) {
  Random random{.seed = 3};
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  int ones = 0;
  for (int i = 0; i < 10'000; ++i) {
    EXPECT_EQ(random.uniform(1, 1 + kEpsilon), 1);
    EXPECT_EQ(random.uniform(7, 7), 7);
    // The range contains two numbers, and each gets half of the draws.
    const double number = random.uniform(1, 1 + 2 * kEpsilon);
    EXPECT_TRUE(number == 1 || number == 1 + kEpsilon);
    if (number == 1) ++ones;
  }
  EXPECT_NEAR(ones, 5000, 4 * 50);
}

// Chi-square test over all faces.
TEST(Random, GivesEachIntegerTheSameChance) {
  Random random{.seed = 4};
  for (const int faces : {2, 3, 6, 10, 100}) {
    constexpr int kThrows = 100'000;
    std::vector<int> counts(static_cast<std::size_t>(faces));
    for (int i = 0; i < kThrows; ++i) {
      const std::int64_t face = random.integer(-3, faces - 3);
      ASSERT_TRUE(face >= -3 && face < faces - 3);
      ++counts[static_cast<std::size_t>(face + 3)];
    }
    const double expected = static_cast<double>(kThrows) / faces;
    double sum = 0.0;
    for (const int count : counts) sum += (count - expected) * (count - expected) / expected;
    const double freedom = faces - 1;
    EXPECT_LT(sum, freedom + 4 * std::sqrt(2 * freedom) + 4) << faces;
  }
}

// The range is three quarters of 2^64. With a plain remainder, numbers in the first third would
// come twice as often as the rest.
TEST(Random, HasNoBiasWhereTheRangeIsNearlyThatOfTheGenerator) {
  Random random{.seed = 5};
  constexpr std::int64_t kQuarter = std::int64_t{1} << 62U;
  int first = 0;
  for (int i = 0; i < 30'000; ++i) {
    const std::int64_t number = random.integer(kLowest, kQuarter);
    ASSERT_LT(number, kQuarter);
    if (number < kLowest + kQuarter) ++first;
  }
  EXPECT_NEAR(first, 10'000, 4 * std::sqrt(30'000 * 2.0 / 9));
}

TEST(Random, AnswersForARangeWithoutIntegers) {
  Random random;
  EXPECT_EQ(random.integer(5, 5), 5);
  EXPECT_EQ(random.integer(5, 4), 5);
}

TEST(Random, HasStreamsThatNeverMeet) {
  std::set<std::array<std::uint64_t, 4>> seen;
  std::size_t streams = 0;
  for (const std::uint64_t seed : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{1} << 32U}) {
    for (std::uint64_t episode = 0; episode < 200; ++episode) {
      Random random{.seed = seed, .episode = episode};
      for (int i = 0; i < 20; ++i) {
        std::array<std::uint64_t, 4> numbers{};
        for (std::uint64_t& number : numbers) {
          number = static_cast<std::uint64_t>(random.integer(kLowest, kHighest));
        }
        seen.insert(numbers);
        ++streams;
      }
    }
  }
  EXPECT_EQ(seen.size(), streams);
}

TEST(Random, HasStreamsThatKnowNothingOfEachOther) {
  constexpr std::size_t kCount = 20'000;
  const auto stream = [](std::uint64_t seed, std::uint64_t episode, std::uint64_t count) {
    Random random{.seed = seed, .episode = episode, .count = count};
    return drawn(kCount, [&] { return random.normal(); });
  };
  const std::vector<double> one = stream(0, 0, 0);
  const double limit = 4 / std::sqrt(static_cast<double>(kCount));
  for (unsigned bit = 0; bit < 64; ++bit) {
    const std::uint64_t other = std::uint64_t{1} << bit;
    EXPECT_LT(std::abs(correlation(one, stream(other, 0, 0))), limit) << "seed " << other;
    EXPECT_LT(std::abs(correlation(one, stream(0, other, 0))), limit) << "episode " << other;
  }
  // The numbers of one stream do not depend on each other either.
  const std::vector<double> same = stream(0, 0, 1);
  EXPECT_NEAR(correlation(one, one), 1, 0.05);
  std::vector<double> shifted(one.begin() + 1, one.end());
  shifted.push_back(0);
  EXPECT_LT(std::abs(correlation(one, shifted)), limit);
  EXPECT_NE(one, same);
}

}  // namespace
}  // namespace trifinger
