// SPDX-License-Identifier: BSD-3-Clause
#include "base/latest.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace trifinger {
namespace {

using Numbers = std::vector<int>;

TEST(Latest, ReadsWhatWasWrittenLast) {
  Latest<int> latest(7);
  int value = 0;
  EXPECT_FALSE(latest.read(value));
  EXPECT_EQ(value, 7);
  for (int i = 0; i < 10; ++i) {
    for (int k = 0; k <= i % 4; ++k) latest.write(10 * i + k);
    EXPECT_TRUE(latest.read(value));
    EXPECT_EQ(value, 10 * i + i % 4);
    EXPECT_FALSE(latest.read(value));
    EXPECT_EQ(value, 10 * i + i % 4);
  }
}

TEST(Latest, KeepsWhatIsSeenUntilTheNextUpdate) {
  Latest<int> latest(0);
  latest.write(1);
  EXPECT_TRUE(latest.update());
  for (int i = 2; i < 9; ++i) {
    latest.own() = i;
    EXPECT_EQ(latest.seen(), 1);
    latest.publish();
    EXPECT_EQ(latest.seen(), 1);
  }
  EXPECT_TRUE(latest.update());
  EXPECT_EQ(latest.seen(), 8);
}

// ThreadSanitizer sees each access, and whole values prove that none was torn.
TEST(Latest, ValuesAreWholeAndNeverGetOlder) {
  constexpr int kWrites = 20000;
  Latest<Numbers> latest(Numbers(50, 0));
  std::atomic<bool> has_begun{false};
  std::thread writer([&] {
    has_begun.store(true);
    Numbers numbers(50);
    for (int i = 1; i <= kWrites; ++i) {
      if (i % 2 == 0) {
        std::ranges::fill(latest.own(), i);
        latest.publish();
      } else {
        std::ranges::fill(numbers, i);
        latest.write(numbers);
      }
    }
  });
  while (!has_begun.load()) std::this_thread::yield();
  Numbers copy(50);
  int newest = 0;
  while (newest < kWrites) {
    const bool is_new = newest % 3 == 0 ? latest.read(copy) : latest.update();
    const Numbers& seen = latest.seen();
    ASSERT_TRUE(std::ranges::all_of(seen, [&](int number) { return number == seen[0]; }));
    if (is_new) {
      ASSERT_GT(seen[0], newest);
    } else {
      ASSERT_EQ(seen[0], newest);
    }
    newest = seen[0];
    if (!is_new) std::this_thread::yield();
  }
  writer.join();
}

}  // namespace
}  // namespace trifinger
