// SPDX-License-Identifier: BSD-3-Clause
#include "ipc/ring.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <thread>
#include <vector>

#include "support/soak.hpp"

namespace trifinger::ipc {
namespace {

// A ring with its own memory.
class OwnedRing {
 public:
  explicit OwnedRing(const RingShape& shape)
      : memory_(shape.size() / 8), ring_(reinterpret_cast<std::byte*>(memory_.data()), shape) {}

  const Ring* operator->() const noexcept { return &ring_; }
  const Ring& operator*() const noexcept { return ring_; }

 private:
  std::vector<std::uint64_t> memory_;
  Ring ring_;
};

// Returns the bytes of element `index`. Every byte depends on the index and on its place, so any
// mixture is noticed.
std::vector<std::byte> element_of(std::int64_t index, std::size_t size) {
  std::vector<std::byte> element(size);
  std::minstd_rand random(static_cast<std::uint32_t>(index) + 1);
  for (std::byte& byte : element) byte = static_cast<std::byte>(random() >> 8U);
  return element;
}

// The sequence number of this element is the largest even one.
constexpr std::int64_t kLastIndex = std::numeric_limits<std::int64_t>::max() - 1;

TEST(RingShape, CountsASequenceNumberAndWholeWordsPerSlot) {
  const RingShape shape{.capacity = 4, .element_size = 9};
  EXPECT_EQ(shape.words(), 2U);
  EXPECT_EQ(shape.slot_size(), 24U);
  EXPECT_EQ(shape.size(), 96U);
}

TEST(RingShape, IsInvalidIfItIsNoPowerOfTwoOrEmptyOrCouldOverflow) {
  EXPECT_TRUE((RingShape{.capacity = 1, .element_size = 1}.is_valid()));
  EXPECT_TRUE((RingShape{.capacity = 1U << 30U, .element_size = 1U << 30U}.is_valid()));
  EXPECT_FALSE((RingShape{.capacity = 0, .element_size = 8}.is_valid()));
  EXPECT_FALSE((RingShape{.capacity = 3, .element_size = 8}.is_valid()));
  EXPECT_FALSE((RingShape{.capacity = 4, .element_size = 0}.is_valid()));
  EXPECT_FALSE((RingShape{.capacity = 1ULL << 31U, .element_size = 8}.is_valid()));
  EXPECT_FALSE((RingShape{.capacity = 4, .element_size = (1ULL << 30U) + 1}.is_valid()));
  EXPECT_FALSE((RingShape{.capacity = 1ULL << 63U, .element_size = 8}.is_valid()));
}

TEST(Ring, HasNothingInTheBeginning) {
  const OwnedRing ring({.capacity = 4, .element_size = 8});
  std::uint64_t element = 0;
  for (std::int64_t i = 0; i < 10; ++i) EXPECT_EQ(ring->read(i, &element), ReadResult::kNotYet);
}

TEST(Ring, KeepsTheNewestElementsWhateverItsShape) {
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    const RingShape shape{.capacity = std::uint64_t{1} << (random() % 7),
                          .element_size = 1 + random() % 70};
    const OwnedRing ring(shape);
    const auto count = static_cast<std::int64_t>(random() % 200);
    for (std::int64_t i = 0; i < count; ++i)
      ring->write(i, element_of(i, shape.element_size).data());

    for (std::int64_t i = 0; i < count + 3; ++i) {
      // The buffer has one byte more than the element. That byte must not be touched.
      std::vector<std::byte> element(shape.element_size + 1, std::byte{0xA5});
      const ReadResult result = ring->read(i, element.data());
      EXPECT_EQ(element.back(), std::byte{0xA5});
      if (i >= count) {
        EXPECT_EQ(result, ReadResult::kNotYet);
      } else if (i < count - static_cast<std::int64_t>(shape.capacity)) {
        EXPECT_EQ(result, ReadResult::kLost);
      } else {
        ASSERT_EQ(result, ReadResult::kDone);
        element.pop_back();
        EXPECT_EQ(element, element_of(i, shape.element_size));
      }
    }
  }
}

TEST(Ring, HidesAnElementWhileItIsWritten) {
  const OwnedRing ring({.capacity = 2, .element_size = 8});
  const std::uint64_t element = 42;
  ring->write(0, &element);
  EXPECT_EQ(ring->sequence_in_slot(0), Ring::sequence_of(0));
  EXPECT_EQ(ring->sequence_in_slot(2), Ring::sequence_of(0)) << "the same slot";
}

// A robot that has run for ages: the law of a ring holds around every power of two at which a
// shorter number would break, up to the last index whose sequence number has 64 bits.
class LargeIndex : public ::testing::TestWithParam<std::int64_t> {};

TEST_P(LargeIndex, fault_71_IsAnIndexLikeAnyOther) {
  constexpr std::int64_t kCapacity = 8;
  constexpr std::size_t kSize = 20;
  const OwnedRing ring({.capacity = kCapacity, .element_size = kSize});
  const std::int64_t first = GetParam() - 2 * kCapacity;
  const std::int64_t last = GetParam() + std::min(2 * kCapacity, kLastIndex - GetParam());
  std::vector<std::byte> element(kSize);
  for (std::int64_t written = first; written <= last; ++written) {
    EXPECT_EQ(ring->read(written, element.data()), ReadResult::kNotYet);
    ring->write(written, element_of(written, kSize).data());
    EXPECT_EQ(ring->sequence_in_slot(written), Ring::sequence_of(written));
    for (std::int64_t i = first; i <= written; ++i) {
      if (i <= written - kCapacity) {
        EXPECT_EQ(ring->read(i, element.data()), ReadResult::kLost) << i;
      } else {
        ASSERT_EQ(ring->read(i, element.data()), ReadResult::kDone) << i;
        EXPECT_EQ(element, element_of(i, kSize)) << i;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(PowersOfTwo, LargeIndex,
                         ::testing::Values(std::int64_t{1} << 31U, std::int64_t{1} << 32U,
                                           std::int64_t{1} << 53U, std::int64_t{1} << 62U,
                                           kLastIndex));

// One writer, several readers, random shapes: whenever a reader is told that it has an element,
// that element is whole and is the one it asked for. Under the thread sanitizer this also shows
// that the words are ordered by nothing but themselves.
TEST(Ring, fault_34_NeverShowsATornElement) {
  constexpr int kRounds = 8;
  const std::int64_t reads_per_round = test::repetitions(100'000, 100'000'000) / kRounds;
  test::ProgressLine progress(kRounds * reads_per_round);
  std::mt19937 random(2);
  std::int64_t whole = 0;
  std::int64_t lost = 0;
  for (int round = 0; round < kRounds; ++round) {
    const RingShape shape{.capacity = std::uint64_t{1} << (random() % 5),
                          .element_size = 1 + random() % 200};
    const OwnedRing ring(shape);
    std::atomic<std::int64_t> end{0};
    std::atomic<bool> is_over{false};
    struct Count {
      std::atomic<std::int64_t> whole{0};
      std::atomic<std::int64_t> lost{0};
    };
    std::array<Count, 3> counts;
    std::vector<std::thread> readers;
    readers.reserve(counts.size());
    for (std::uint32_t reader = 0; reader < counts.size(); ++reader) {
      readers.emplace_back([&, reader] {
        std::minstd_rand choice(reader + 1);
        std::vector<std::byte> element(shape.element_size);
        Count& count = counts[reader];
        while (!is_over.load(std::memory_order_relaxed) || count.whole == 0) {
          const std::int64_t last = end.load(std::memory_order_acquire);
          const auto back = static_cast<std::int64_t>(choice() % (2 * shape.capacity));
          const std::int64_t index = std::max<std::int64_t>(0, last - back);
          switch (ring->read(index, element.data())) {
            case ReadResult::kDone:
              ASSERT_EQ(element, element_of(index, shape.element_size)) << index;
              ++count.whole;
              break;
            case ReadResult::kNotYet:
              ASSERT_GE(index, last) << "an element that was published is missing";
              break;
            case ReadResult::kLost:
              ++count.lost;
              break;
          }
        }
      });
    }
    const auto reads = [&] {
      std::int64_t sum = 0;
      for (const Count& count : counts) sum += count.whole + count.lost;
      return sum;
    };
    for (std::int64_t i = 0; reads() < reads_per_round && !HasFailure(); ++i) {
      progress.update(round * reads_per_round + reads());
      ring->write(i, element_of(i, shape.element_size).data());
      end.store(i + 1, std::memory_order_release);
    }
    is_over.store(true, std::memory_order_relaxed);
    for (std::thread& reader : readers) reader.join();
    for (const Count& count : counts) {
      whole += count.whole;
      lost += count.lost;
    }
  }
  std::printf("%lld reads whole, %lld overtaken by the writer, none torn\n",
              static_cast<long long>(whole), static_cast<long long>(lost));
}

}  // namespace
}  // namespace trifinger::ipc
