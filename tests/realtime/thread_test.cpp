// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/realtime/thread.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>

#include <string>
#include <thread>
#include <vector>

#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

// What a thread asks for, in a thread of its own: the rest of the program stays as it is. Memory is
// not locked here, since a sanitizer's shadow would have to be locked as well.
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

// No machine has it.
constexpr RealtimeOptions kImpossible{.priority = 1000, .lock_memory = false};

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
  EXPECT_THAT(answer.refused[0], ::testing::HasSubstr("limits.conf"));
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
  const Answer answer = ask({.demand = Demand::kTry, .priority = 1, .lock_memory = false});
  EXPECT_EQ(answer.policy == SCHED_FIFO, answer.refused.empty());
}

}  // namespace
}  // namespace trifinger
