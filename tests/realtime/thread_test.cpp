// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/realtime/thread.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "realtime/limit_remedy.hpp"
#include "support/child_process.hpp"
#include "support/nobody.hpp"
#include "support/sanitizers.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

// Asks for real time in a separate thread, so that the rest of the program stays unchanged. Memory
// is not locked there, because a sanitizer's shadow would have to be locked as well.
struct Answer {
  std::vector<std::string> refused;
  std::string error;
  int policy{-1};
};

Answer ask(const RealtimeOptions& options) {
  Answer answer;
  std::thread([&] {
    try {
      answer.refused = enter_realtime(options);
    } catch (const Error& error) {
      answer.error = error.what();
    }
    answer.policy = ::sched_getscheduler(0);
  }).join();
  return answer;
}

// No machine can grant these options.
constexpr RealtimeOptions kImpossible{
    .priority = 1000, .lock_memory = false, .heap = 0, .keep_cpus_awake = false};

TEST(EnterRealtime, AsksForNothingWhenOff) {
  RealtimeOptions options = kImpossible;
  options.demand = Demand::kOff;
  const Answer answer = ask(options);
  EXPECT_THAT(answer.refused, ::testing::IsEmpty());
  EXPECT_EQ(answer.error, "");
  EXPECT_EQ(answer.policy, SCHED_OTHER);
}

TEST(EnterRealtime, SaysWhatWasRefusedAndTheRemedyWhenItTries) {
  RealtimeOptions options = kImpossible;
  options.demand = Demand::kTry;
  const Answer answer = ask(options);
  ASSERT_THAT(answer.refused, ::testing::SizeIs(1));
  EXPECT_THAT(answer.refused[0], ::testing::HasSubstr("priority 1000"));
  EXPECT_THAT(answer.refused[0], ::testing::HasSubstr(remedy_for(RealtimeLimit::kPriority)));
  EXPECT_EQ(answer.error, "");
}

TEST(EnterRealtime, ThrowsWhatWasRefusedWhenItIsRequired) {
  RealtimeOptions options = kImpossible;
  options.demand = Demand::kRequire;
  const Answer answer = ask(options);
  EXPECT_THAT(answer.error, ::testing::HasSubstr("priority 1000"));
}

TEST(EnterRealtime, NamesEverySettingThatWasRefused) {
  RealtimeOptions options = kImpossible;
  options.demand = Demand::kRequire;
  options.cpu = 1000;
  const Answer answer = ask(options);
  EXPECT_THAT(answer.error, ::testing::HasSubstr("priority 1000"));
  EXPECT_THAT(answer.error, ::testing::HasSubstr("processor 1000"));
}

TEST(EnterRealtime, EitherHasThePriorityOrSaysThatItHasNot) {
  const Answer answer = ask({.demand = Demand::kTry,
                             .priority = 1,
                             .lock_memory = false,
                             .heap = 0,
                             .keep_cpus_awake = false});
  EXPECT_EQ(answer.policy == SCHED_FIFO, answer.refused.empty());
}

// --- Memory
// ----------------------------------------------------------------------------------------------

[[nodiscard]] long page_faults() {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt;
}

// A separate process, because a heap that was filled once stays filled.
TEST(EnterRealtime, fault_57_TheHeapThatWasAskedForIsThereBeforeItIsUsed) {
  if (test::kHasSanitizer) GTEST_SKIP() << "a sanitizer has a heap of its own";
  test::ChildProcess child([] {
    int code = 1;
    std::thread([&code] {
      constexpr std::size_t kUsed = 4U << 20U;
      enter_realtime({.priority = 1, .lock_memory = false, .heap = 2 * kUsed});
      const long before = page_faults();
      for (int i = 0; i < 3; ++i) {
        void* const block = std::malloc(kUsed);
        std::memset(block, i, kUsed);
        asm volatile("" : : "r"(block) : "memory");
        std::free(block);
      }
      const long faults = page_faults() - before;
      // The bookkeeping of malloc may be in a page of its own.
      code = faults <= 2 ? 0 : 2;
    }).join();
    return code;
  });
  EXPECT_EQ(child.wait(), 0);
}

// Returns the text after `name` in /proc/self/status.
[[nodiscard]] std::string own_status(std::string_view name) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(name)) return line.substr(name.size() + 1);
  }
  return "";
}

TEST(EnterRealtime, fault_57_AllMemoryIsLockedWhereThatIsAllowed) {
  if (test::kHasSanitizer) GTEST_SKIP() << "a sanitizer's shadow cannot be locked";
  if (::geteuid() != 0) GTEST_SKIP() << "only the administrator has the right for sure";
  test::ChildProcess child([] {
    const std::vector<std::string> refused =
        enter_realtime({.priority = 1, .keep_cpus_awake = false});
    for (const std::string& sentence : refused) {
      // A container may have removed this right.
      if (sentence.find("memory") != std::string::npos) return 77;
    }
    return std::stol(own_status("VmLck:")) > 0 ? 0 : 1;
  });
  const int code = child.wait();
  if (code == 77) GTEST_SKIP() << "this machine does not let the administrator lock memory";
  EXPECT_EQ(code, 0);
}

// --- Without rights
// --------------------------------------------------------------------------------------

// Becomes a user who may have a real-time priority up to `priority`, and nothing else.
void become_nobody_without_rights(rlim_t priority) {
  const rlimit highest{.rlim_cur = priority, .rlim_max = priority};
  const rlimit little{.rlim_cur = 64U << 10U, .rlim_max = 64U << 10U};
  if (::setrlimit(RLIMIT_RTPRIO, &highest) != 0 || ::setrlimit(RLIMIT_MEMLOCK, &little) != 0) {
    throw SystemError("lower limits", errno);
  }
  test::become_nobody();
}

// What a user without rights is told. The child returns the sentences as its exit code: one bit for
// each expected sentence, and one for any other.
class Nobody {
 public:
  static constexpr int kPriority = 1;
  static constexpr int kMemory = 2;
  static constexpr int kCpus = 4;
  static constexpr int kOther = 8;
  static constexpr int kThrew = 16;
  static constexpr int kWatchdog = 32;

  [[nodiscard]] static int ask(Demand demand, rlim_t priority = 0) {
    test::ChildProcess child([demand, priority] {
      become_nobody_without_rights(priority);
      try {
        int found = 0;
        for (const std::string& sentence : enter_realtime({.demand = demand})) {
          found |= kind_of(sentence);
        }
        return found;
      } catch (const Error& error) {
        int found = kThrew;
        std::istringstream lines(error.what());
        std::string line;
        std::getline(lines, line);  // the heading
        while (std::getline(lines, line)) found |= kind_of(line);
        return found;
      }
    });
    return child.wait();
  }

 private:
  // Each sentence says what was refused, why, and the remedy.
  [[nodiscard]] static int kind_of(const std::string& sentence) {
    const auto has = [&sentence](std::string_view text) {
      return sentence.find(text) != std::string::npos;
    };
    if (sentence.find('\n') != std::string::npos) return kOther;
    if (has("no real-time priority 80: Operation not permitted") && has("rtprio")) {
      return kPriority;
    }
    if (has("its watchdog cannot have a higher priority than the loop: ") &&
        has("no real-time priority 81: Operation not") && has("or choose a lower priority")) {
      return kWatchdog;
    }
    if (has("memory is not locked: the limit is 64 KiB") && has("memlock")) {
      return kMemory;
    }
    if (has("processors may fall asleep: /dev/cpu_dma_latency") && has("udev rule")) return kCpus;
    return kOther;
  }
};

TEST(EnterRealtime, fault_58_WithoutPermissionItGoesOnAndSaysWhatToDoInALineEach) {
  if (!test::may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  EXPECT_EQ(Nobody::ask(Demand::kTry), Nobody::kPriority | Nobody::kMemory | Nobody::kCpus);
}

// Without this message, nobody would know that a hanging driver stays undetected.
TEST(EnterRealtime, fault_58_WithoutAPriorityForItsWatchdogItSaysSo) {
  // There is no priority above.
  const Answer answer =
      ask({.priority = 99, .lock_memory = false, .heap = 0, .keep_cpus_awake = false});
  ASSERT_THAT(answer.refused, ::testing::SizeIs(1));
  EXPECT_THAT(answer.refused[0],
              ::testing::HasSubstr(answer.policy == SCHED_FIFO
                                       ? "its watchdog cannot have a higher priority than the "
                                         "loop: no real-time priority 100"
                                       : "no real-time priority 99"));
}

TEST(EnterRealtime, fault_58_WithoutPermissionForItsWatchdogItSaysSo) {
  if (!test::may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  rlimit limit{};
  ::getrlimit(RLIMIT_RTPRIO, &limit);
  limit.rlim_max = std::max<rlim_t>(limit.rlim_max, 81);
  if (::setrlimit(RLIMIT_RTPRIO, &limit) != 0) {
    GTEST_SKIP() << "this machine does not let the administrator give permissions";
  }
  EXPECT_EQ(Nobody::ask(Demand::kTry, 80), Nobody::kWatchdog | Nobody::kMemory | Nobody::kCpus);
  EXPECT_EQ(Nobody::ask(Demand::kTry, 81), Nobody::kMemory | Nobody::kCpus);
}

TEST(EnterRealtime, AThreadKnowsWhatItLacks) {
  std::vector<std::string> before;
  std::vector<std::string> refused;
  std::vector<std::string> after;
  std::thread([&] {
    before = realtime_warnings();
    refused = enter_realtime(kImpossible);
    after = realtime_warnings();
  }).join();
  EXPECT_THAT(before, ::testing::ElementsAre("no real-time settings were asked for"));
  EXPECT_THAT(after, ::testing::ElementsAreArray(refused));
  EXPECT_EQ(realtime_warnings(), before) << "of another thread";
}

TEST(EnterRealtime, fault_57_ALimitThatForbidsToLockMemoryIsNamedWithItsRemedy) {
  if (!test::may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  EXPECT_NE(Nobody::ask(Demand::kTry) & Nobody::kMemory, 0);
}

TEST(EnterRealtime, fault_58_WithoutPermissionItFailsWithAllLinesWhereItIsRequired) {
  if (!test::may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  EXPECT_EQ(Nobody::ask(Demand::kRequire),
            Nobody::kThrew | Nobody::kPriority | Nobody::kMemory | Nobody::kCpus);
}

TEST(EnterRealtime, fault_58_WhereNothingIsAskedForNothingIsSaid) {
  if (!test::may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  EXPECT_EQ(Nobody::ask(Demand::kOff), 0);
}

// --- Processors that stay awake
// ---------------------------------------------------------------------------------

// Returns the number of descriptors with which this process keeps processors awake.
[[nodiscard]] int awake_files() {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code ignored;
    count += std::filesystem::read_symlink(entry, ignored) == "/dev/cpu_dma_latency" ? 1 : 0;
  }
  return count;
}

TEST(EnterRealtime, KeepsProcessorsAwakeAsLongAsTheThreadLives) {
  if (::access("/dev/cpu_dma_latency", W_OK) != 0) GTEST_SKIP() << "not allowed here";
  const RealtimeOptions options{.priority = 1, .lock_memory = false, .heap = 0};
  std::vector<int> files;
  std::thread([&] {
    enter_realtime(options);
    files.push_back(awake_files());
    enter_realtime(options);
    files.push_back(awake_files());
  }).join();
  files.push_back(awake_files());
  EXPECT_THAT(files, ::testing::ElementsAre(1, 1, 0));
}

TEST(EnterRealtime, fault_64_AForkedChildKeepsNoProcessorAwake) {
  if (::access("/dev/cpu_dma_latency", W_OK) != 0) GTEST_SKIP() << "not allowed here";
  test::ChildProcess child([] {
    // The only thread of a separate process forks.
    enter_realtime({.priority = 1, .lock_memory = false, .heap = 0});
    test::ChildProcess grandchild([] { return awake_files(); });
    return awake_files() == 1 ? grandchild.wait() : 2;
  });
  EXPECT_EQ(child.wait(), 0);
}

}  // namespace
}  // namespace trifinger
