// SPDX-License-Identifier: BSD-3-Clause
#include "ipc/futex.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <thread>

#include "ipc/shared_memory.hpp"
#include "support/child_process.hpp"
#include "support/shared_value.hpp"
#include "support/soak.hpp"

namespace trifinger::ipc {
namespace {

constexpr Nanoseconds kDays = std::chrono::hours(100);

TEST(Futex, DoesNotSleepIfTheWordHasChanged) {
  const std::atomic<std::uint32_t> word{1};
  futex_wait(word, 0, kDays);
}

TEST(Futex, DoesNotSleepWithoutTime) {
  const std::atomic<std::uint32_t> word{0};
  futex_wait(word, 0, Nanoseconds::zero());
  futex_wait(word, 0, Nanoseconds(-1));
}

TEST(Futex, ReturnsWhenItsTimeIsOver) {
  const std::atomic<std::uint32_t> word{0};
  futex_wait(word, 0, std::chrono::milliseconds(1));
}

struct Words {
  std::atomic<std::uint32_t> ping{0};
  std::atomic<std::uint32_t> pong{0};
};

// Waits until `word` is `value`, without a timeout.
void wait_for(const std::atomic<std::uint32_t>& word, std::uint32_t value) {
  while (true) {
    const std::uint32_t seen = word.load(std::memory_order_acquire);
    if (seen == value) return;
    futex_wait(word, seen, kDays);
  }
}

// Number of rounds, with two wake-ups each: 10^7 wake-ups in `./run soak`. A wake-up takes some
// microseconds, or tens of them if processors fall asleep in between.
std::uint32_t rounds() { return static_cast<std::uint32_t>(test::repetitions(20'000, 5'000'000)); }

// Every wake-up is needed. If one is lost, both sides sleep for days, and the watchdog of the tests
// ends that.
void play(Words& words, bool is_first) {
  const std::uint32_t last = rounds();
  test::ProgressLine progress(last);
  for (std::uint32_t i = 1; i <= last; ++i) {
    if (is_first) progress.update(i);
    if (!is_first) wait_for(words.ping, i);
    auto& mine = is_first ? words.ping : words.pong;
    mine.store(i, std::memory_order_release);
    futex_wake_all(mine);
    if (is_first) wait_for(words.pong, i);
  }
}

TEST(Futex, fault_36_LosesNoWakeBetweenThreads) {
  Words words;
  std::thread other([&] { play(words, false); });
  play(words, true);
  other.join();
  std::printf("%u wakes between threads, none lost\n", 2 * rounds());
}

TEST(Futex, fault_36_LosesNoWakeBetweenProcesses) {
  test::SharedValue<Words> words;
  test::ChildProcess other([&] {
    play(*words, false);
    return 0;
  });
  play(*words, true);
  EXPECT_EQ(other.wait(), 0);
  std::printf("%u wakes between processes, none lost\n", 2 * rounds());
}

TEST(Futex, WakesSleepersOnAReadOnlyMapping) {
  SharedMemory writable = SharedMemory::create_anonymous(4096);
  const SharedMemory read_only = writable.reopen(Access::kReadOnly);
  auto& word = *reinterpret_cast<std::atomic<std::uint32_t>*>(writable.data());
  const auto& seen = *reinterpret_cast<const std::atomic<std::uint32_t>*>(read_only.data());
  std::thread sleeper([&] { wait_for(seen, 1); });
  word.store(1, std::memory_order_release);
  futex_wake_all(word);
  sleeper.join();
}

}  // namespace
}  // namespace trifinger::ipc
