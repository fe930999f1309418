// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/fault.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "trifinger/core/errors.hpp"

namespace trifinger {
namespace {

constexpr Fault::Code kAll[] = {Fault::Code::kNone,
                                Fault::Code::kFinished,
                                Fault::Code::kDetached,
                                Fault::Code::kControllerDied,
                                Fault::Code::kStopped,
                                Fault::Code::kFirstActionLate,
                                Fault::Code::kActionLate,
                                Fault::Code::kBackendLate,
                                Fault::Code::kActionsRejected,
                                Fault::Code::kMemoryDamaged,
                                Fault::Code::kDriver,
                                Fault::Code::kDriverHangs,
                                Fault::Code::kBackendDied,
                                Fault::Code::kExhausted,
                                Fault::Code::kMeasurementStale,
                                Fault::Code::kMachineSuspended};

TEST(Fault, HasANameAndASentenceForEveryCode) {
  std::set<std::string> names;
  std::set<std::string> sentences;
  for (const Fault::Code code : kAll) {
    names.emplace(name_of(code));
    sentences.insert(describe({.code = code, .detail = 3, .time_index = 17}));
  }
  EXPECT_EQ(names.size(), std::size(kAll));
  EXPECT_EQ(sentences.size(), std::size(kAll));
  EXPECT_FALSE(names.contains("unknown"));
}

TEST(Fault, ToleratesCodesOfLaterVersions) {
  EXPECT_EQ(name_of(static_cast<Fault::Code>(1000)), "unknown");
  EXPECT_THAT(describe({.code = static_cast<Fault::Code>(1000)}), ::testing::HasSubstr("1000"));
}

TEST(Fault, NeedsRecoveryOnlyIfSomethingWentWrong) {
  for (const Fault::Code code :
       {Fault::Code::kNone, Fault::Code::kFinished, Fault::Code::kDetached,
        Fault::Code::kControllerDied, Fault::Code::kStopped, Fault::Code::kExhausted}) {
    EXPECT_FALSE(Fault{.code = code}.needs_recovery()) << name_of(code);
  }
  for (const Fault::Code code :
       {Fault::Code::kFirstActionLate, Fault::Code::kActionLate, Fault::Code::kBackendLate,
        Fault::Code::kActionsRejected, Fault::Code::kMemoryDamaged, Fault::Code::kDriver,
        Fault::Code::kDriverHangs, Fault::Code::kMeasurementStale,
        Fault::Code::kMachineSuspended}) {
    EXPECT_TRUE(Fault{.code = code}.needs_recovery()) << name_of(code);
  }
}

TEST(Fault, TellsTheStepAndTheRemedyOfALateAction) {
  EXPECT_THAT(describe({.code = Fault::Code::kActionLate, .detail = 4, .time_index = 1234}),
              ::testing::AllOf(::testing::HasSubstr("step 1234"), ::testing::HasSubstr("4 repeats"),
                               ::testing::HasSubstr("append it earlier")));
}

TEST(Fault, TellsHowTheBackendWasLate) {
  EXPECT_THAT(describe({.code = Fault::Code::kBackendLate, .detail = 6, .time_index = 5}),
              ::testing::HasSubstr("late by 6 periods at step 5"));
  EXPECT_THAT(describe({.code = Fault::Code::kBackendLate, .detail = -6, .time_index = 5}),
              ::testing::HasSubstr("late in 6 steps in a row at step 5"));
}

TEST(Fault, TellsWhatTheDriverSaidOrItsCode) {
  const Fault fault{.code = Fault::Code::kDriver, .detail = 99, .time_index = 5};
  EXPECT_THAT(describe(fault, "joint 3 is hot"), ::testing::HasSubstr("joint 3 is hot"));
  EXPECT_THAT(describe(fault), ::testing::HasSubstr("99"));
}

TEST(HistoryLost, CarriesTheOldestStep) {
  const HistoryLost lost(3, 40);
  EXPECT_EQ(lost.oldest(), 40);
  EXPECT_THAT(lost.what(),
              ::testing::AllOf(::testing::HasSubstr("step 3"), ::testing::HasSubstr("40")));
}

TEST(RobotStopped, CarriesTheFault) {
  const Fault fault{.code = Fault::Code::kDriver, .detail = 9, .time_index = 5};
  EXPECT_EQ(RobotStopped(fault, "x").fault(), fault);
}

}  // namespace
}  // namespace trifinger
