// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/bus.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <numeric>
#include <ostream>
#include <string>
#include <tuple>
#include <vector>

#include "dynamixel/rig.hpp"
#include "support/allocation_counter.hpp"

namespace trifinger::dynamixel::test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint16_t kPresent = registers::kPresentCurrent.address;
constexpr std::size_t kPresentSize = 10;

double seconds(Nanoseconds duration) { return std::chrono::duration<double>(duration).count(); }

// A value of the tables of rates: sync read of ten bytes, sync write of positions.
struct Rate {
  int baud;
  Nanoseconds return_delay;
  bool is_fast;
  double hertz;
  std::size_t num_motors{9};
};

class RatesOfABus : public ::testing::TestWithParam<Rate> {};

TEST_P(RatesOfABus, AreThoseOfTheArithmetic) {
  const Rate& rate = GetParam();
  std::vector<MotorId> ids(rate.num_motors);
  std::iota(ids.begin(), ids.end(), MotorId{0});
  Rig rig({.ids = ids, .baud = rate.baud, .return_delay = rate.return_delay});
  const std::vector<std::uint8_t> goals(4 * rig.ids.size());
  constexpr int kCycles = 100;
  for (int i = 0; i < kCycles; ++i) {
    EXPECT_EQ(rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers, rate.is_fast),
              rate.num_motors);
    EXPECT_EQ(rig.bus.sync_write(rig.ids, registers::kGoalPosition.address, 4, goals),
              Outcome::kDone);
  }
  rig.bus.wait_until_sent();
  const double measured = kCycles / seconds(rig.elapsed());
  EXPECT_NEAR(measured / rate.hertz, 1.0, 0.03) << measured << " Hz";
  EXPECT_EQ(rig.bus.counts().missing, 0U);
  EXPECT_EQ(rig.line.counts().collisions, 0U);
}

INSTANTIATE_TEST_SUITE_P(
    Dynamixel, RatesOfABus,
    ::testing::Values(Rate{57'600, 500us, false, 19}, Rate{57'600, 0us, false, 21},
                      Rate{57'600, 0us, true, 27}, Rate{1'000'000, 500us, false, 139},
                      Rate{1'000'000, 0us, false, 369}, Rate{1'000'000, 0us, true, 463},
                      Rate{2'000'000, 500us, false, 171}, Rate{2'000'000, 0us, false, 738},
                      Rate{2'000'000, 0us, true, 926}, Rate{3'000'000, 500us, false, 185},
                      Rate{3'000'000, 0us, false, 1107}, Rate{3'000'000, 0us, true, 1389},
                      Rate{4'000'000, 500us, false, 193}, Rate{4'000'000, 0us, false, 1476},
                      Rate{4'000'000, 0us, true, 1852}, Rate{4'500'000, 500us, false, 196},
                      Rate{4'500'000, 0us, false, 1661}, Rate{4'500'000, 0us, true, 2083},
                      Rate{1'000'000, 0us, false, 217, 16}, Rate{1'000'000, 0us, true, 281, 16},
                      Rate{4'000'000, 0us, false, 870, 16}, Rate{4'000'000, 0us, true, 1124, 16}),
    [](const auto& test) {
      return std::to_string(test.param.num_motors) + "At" + std::to_string(test.param.baud) +
             (test.param.is_fast ? "Fast" : "Classic") +
             std::to_string(test.param.return_delay / 1us) + "us";
    });

TEST(Bus, FindsTheMotorsOfALine) {
  Rig rig;
  std::array<Identity, 20> found{};
  ASSERT_EQ(rig.bus.find_motors(found), rig.ids.size());
  for (std::size_t i = 0; i < rig.ids.size(); ++i) {
    EXPECT_EQ(found[i].id, rig.ids[i]);
    EXPECT_EQ(found[i].model_number, kXm430W210.number);
  }
  std::array<Identity, 2> few{};
  EXPECT_EQ(rig.bus.find_motors(few), few.size());
}

TEST(Bus, ReadsWhatItHasWritten) {
  EXPECT_TRUE(rc::check([] {
    Rig rig({.ids = {7}});
    const std::int32_t sent = *rc::gen::inRange(0, 4096);
    RC_ASSERT(rig.bus.write(7, registers::kGoalPosition, sent).outcome == Outcome::kDone);
    std::int32_t received = 0;
    RC_ASSERT(rig.bus.read(7, registers::kGoalPosition, received).outcome == Outcome::kDone);
    RC_ASSERT(received == sent);
  }));
}

TEST(Bus, ReadsAndWritesBytesThatNeedStuffing) {
  Rig rig({.ids = {7}});
  const std::array<std::uint8_t, 6> sent{0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD};
  const std::uint16_t free_bytes = kIndirectBlocks[0].first_data;
  EXPECT_TRUE(rig.bus.write(7, free_bytes, sent));
  std::array<std::uint8_t, 6> received{};
  EXPECT_TRUE(rig.bus.read(7, free_bytes, received));
  // Indirect data that shows itself keeps nothing; the instruction arrived without damage.
  EXPECT_EQ(rig.bus.counts().damaged, 0U);
}

TEST(Bus, SaysWhyAMotorRefuses) {
  Rig rig({.ids = {7}});
  const auto error_of = [&](const Register& which, std::int32_t value) {
    const Answer answer = rig.bus.write(7, which, value);
    EXPECT_EQ(answer.outcome,
              answer.error == StatusError::kNone ? Outcome::kDone : Outcome::kRefused);
    return text_of(answer.error).name;
  };
  EXPECT_EQ(error_of(registers::kTorqueEnable, 1), "none");
  EXPECT_EQ(error_of(registers::kReturnDelay, 0), "access");
  EXPECT_EQ(error_of(registers::kPresentPosition, 0), "access");
  EXPECT_EQ(error_of(registers::kLed, 2), "data_range");
  EXPECT_EQ(error_of(registers::kGoalPosition, 4096), "data_limit");
  const std::array<std::uint8_t, 1> half{0};
  EXPECT_EQ(rig.bus.write(7, registers::kGoalPosition.address, half).error,
            StatusError::kDataLength);
  EXPECT_EQ(rig.bus.counts().refused, 5U);
}

// The motor does not know what was asked of it, so it is as if its answer was lost.
TEST(Bus, CountsTheAnswerToADamagedInstructionAsMissing) {
  for (const bool is_fast : {false, true}) {
    Rig rig({.line = {.faults = {.misheard = 0.2, .seed = 3}}});
    constexpr int kCycles = 100;
    for (int i = 0; i < kCycles; ++i) {
      const std::size_t count =
          rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers, is_fast);
      std::size_t done = 0;
      for (const MotorAnswer& answer : rig.answers) {
        if (answer.answer) {
          ++done;
        } else {
          EXPECT_EQ(answer.answer.outcome, Outcome::kNoAnswer);
          EXPECT_EQ(answer.answer.error, StatusError::kCrc);
        }
      }
      EXPECT_EQ(count, done);
    }
    std::int32_t value = 0;
    for (int i = 0; i < kCycles; ++i) {
      static_cast<void>(rig.bus.read(10, registers::kPresentPosition, value));
    }
    EXPECT_GT(rig.line.counts().misheard, 0U);
    EXPECT_EQ(rig.bus.counts().missing, rig.line.counts().misheard);
    EXPECT_EQ(rig.bus.counts().answers + rig.bus.counts().missing, kCycles * 10U);
    EXPECT_EQ(rig.bus.counts().refused, 0U);
  }
}

TEST(Bus, SaysThatAMotorIsSilentAfterItsTime) {
  Rig rig({.ids = {7}});
  Identity identity;
  EXPECT_EQ(rig.bus.ping(8, identity).outcome, Outcome::kNoAnswer);
  EXPECT_EQ(rig.bus.counts().missing, 1U);
  // Ten bytes out, fourteen or more back, and the slack.
  EXPECT_GE(rig.elapsed(), rig.bus.options().slack);
  EXPECT_TRUE(rig.bus.ping(7, identity));
  EXPECT_EQ(identity.id, 7);
}

TEST(Bus, DoesNotHearMotorsOfAnotherRate) {
  InertiaPlant plant(1);
  EmulatedBus line({{.id = 1, .baud = 57'600}}, plant, kBegin);
  Bus bus(std::make_unique<EmulatedPort>(line, 1'000'000, kBegin));
  Identity identity;
  EXPECT_EQ(bus.ping(1, identity).outcome, Outcome::kNoAnswer);
}

TEST(Bus, ReportsTheAlertOfAMotorInEveryAnswer) {
  Rig rig;
  rig.line.motor(4).fail(HardwareError::kOverload);
  for (const bool is_fast : {false, true}) {
    ASSERT_EQ(rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers, is_fast), 9U);
    for (std::size_t i = 0; i < 9; ++i) {
      EXPECT_EQ(rig.answers[i].answer.alert, i == 4);
      EXPECT_TRUE(rig.answers[i].answer);
    }
  }
}

TEST(Bus, GoesOnWithoutASilentMotor) {
  for (const bool spreads : {false, true}) {
    Rig rig({.line = {.silence_spreads = spreads}});
    rig.line.motor(5).set_power(false);
    for (const bool is_fast : {false, true}) {
      const std::size_t count =
          rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers, is_fast);
      EXPECT_EQ(count, is_fast || spreads ? 5U : 8U);
      for (std::size_t i = 0; i < 5; ++i) EXPECT_TRUE(rig.answers[i].answer) << i;
      EXPECT_EQ(rig.answers[5].answer.outcome, Outcome::kNoAnswer);
    }
    rig.line.motor(5).set_power(true);
    EXPECT_EQ(rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers), 9U);
  }
}

TEST(Bus, EndsEveryCallWhenTheLineHasGone) {
  Rig rig;
  rig.port->set_plugged(false);
  Identity identity;
  EXPECT_EQ(rig.bus.ping(10, identity).outcome, Outcome::kLineGone);
  EXPECT_EQ(rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers), 0U);
  EXPECT_EQ(rig.answers[0].answer.outcome, Outcome::kLineGone);
  EXPECT_EQ(rig.bus.sync_write(rig.ids, 116, 4, std::vector<std::uint8_t>(36)), Outcome::kLineGone);
}

TEST(Bus, RefusesWhatMakesNoPacket) {
  Rig rig;
  EXPECT_EQ(rig.bus.sync_write(rig.ids, 116, 4, std::vector<std::uint8_t>(35)),
            Outcome::kImpossible);
  rig.bus.sync_read(rig.ids, 0, MotorAnswer::kMaxData + 1, rig.answers);
  EXPECT_EQ(rig.answers[0].answer.outcome, Outcome::kImpossible);
}

TEST(Bus, CountsALateAnswerAndNeverTakesItForANewOne) {
  Rig rig({.ids = {1, 2}, .line = {.faults = {.late = 1.0, .delay = 20ms}}});
  Identity identity;
  EXPECT_EQ(rig.bus.ping(1, identity).outcome, Outcome::kNoAnswer);
  rig.line.set_faults({});
  rig.port->sleep_until(rig.port->now() + 30ms);
  EXPECT_TRUE(rig.bus.ping(2, identity));
  EXPECT_EQ(identity.id, 2);
  EXPECT_EQ(rig.bus.counts().late, 1U);
}

// Each fault alone, in both kinds of reading: probability and what must be counted.
struct LineFault {
  std::string name;
  LineFaults faults;

  friend std::ostream& operator<<(std::ostream& out, const LineFault& fault) {
    return out << fault.name;
  }
};

class FaultyLine : public ::testing::TestWithParam<std::tuple<LineFault, bool>> {};

TEST_P(FaultyLine, IsCountedAndSurvived) {
  const auto& [fault, is_fast] = GetParam();
  LineFaults faults = fault.faults;
  faults.seed = 7;
  Rig rig({.line = {.faults = faults}});
  // A motor shows its number in its position, so an answer of another motor would be seen.
  for (std::size_t i = 0; i < 9; ++i) {
    rig.plant.set_position(i, 100.0 * rig.ids[i] * kPositionUnit);
  }
  rig.port->sleep_until(kBegin + 10ms);
  constexpr std::size_t kCycles = 3000;
  std::uint64_t answers = 0;
  for (std::size_t k = 0; k < kCycles; ++k) {
    answers += rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers, is_fast);
    for (std::size_t i = 0; i < 9; ++i) {
      if (!rig.answers[i].answer) continue;
      const auto position = std::span(rig.answers[i].data).subspan(6, 4);
      ASSERT_EQ(signed_number_in(position), kPositionMiddle + 100 * rig.ids[i]);
    }
  }
  const BusCounts counts = rig.bus.counts();
  const EmulatedBusCounts& injected = rig.line.counts();
  // Every answer that was asked for either came or is missing.
  EXPECT_EQ(counts.answers, answers);
  EXPECT_EQ(counts.answers + counts.missing, 9 * kCycles);
  EXPECT_GT(counts.missing, 0U);
  // Only an old answer that comes in the time of a new one ends a call before its motor has sent.
  EXPECT_LE(injected.collisions, injected.late / 10) << injected.late;
  const bool is_alone = !is_fast && fault.name != "Everything";
  if (is_alone && fault.faults.lost > 0.0) {
    EXPECT_EQ(counts.missing, injected.lost);
    EXPECT_EQ(counts.damaged, 0U);
  }
  if (is_alone && fault.faults.damaged > 0.0) {
    // Damage in a header leaves bytes that belong to no packet.
    EXPECT_EQ(counts.missing, injected.damaged);
    EXPECT_LE(counts.damaged, injected.damaged);
    EXPECT_GT(counts.damaged, injected.damaged / 2);
    EXPECT_GT(counts.skipped, 0U);
  }
  if (is_alone && fault.faults.late > 0.0) {
    EXPECT_GT(counts.late, 0U);
  }
  // Without faults everything is as before.
  rig.line.set_faults({});
  rig.port->sleep_until(rig.port->now() + 1s);
  EXPECT_EQ(rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers, is_fast), 9U);
}

INSTANTIATE_TEST_SUITE_P(
    Dynamixel, FaultyLine,
    ::testing::Combine(::testing::Values(LineFault{"Unheard", {.unheard = 0.02}},
                                         LineFault{"Lost", {.lost = 0.02}},
                                         LineFault{"Damaged", {.damaged = 0.02}},
                                         LineFault{"ByteLost", {.byte_lost = 0.02}},
                                         LineFault{"ByteAdded", {.byte_added = 0.02}},
                                         LineFault{"Late", {.late = 0.02}},
                                         LineFault{"Everything",
                                                   {.unheard = 0.05,
                                                    .lost = 0.05,
                                                    .damaged = 0.05,
                                                    .byte_lost = 0.05,
                                                    .byte_added = 0.05,
                                                    .late = 0.05}}),
                       ::testing::Bool()),
    [](const auto& test) {
      return std::get<0>(test.param).name + (std::get<1>(test.param) ? "Fast" : "Classic");
    });

TEST(FastSyncRead, UsesThePartsInFrontOfDamage) {
  Rig rig({.line = {.faults = {.damaged = 1.0, .seed = 3}}});
  std::size_t used = 0;
  for (int i = 0; i < 100; ++i) {
    used += rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers, true);
  }
  EXPECT_GT(used, 0U);
  EXPECT_LT(used, 900U);
}

TEST(Bus, GivesTheSameCountsForTheSameSeed) {
  const auto run = [](std::uint64_t seed) {
    Rig rig({.line = {.faults = {.lost = 0.1, .damaged = 0.1, .late = 0.1, .seed = seed}}});
    for (int i = 0; i < 200; ++i) rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers);
    const BusCounts counts = rig.bus.counts();
    return std::array{counts.answers, counts.damaged, counts.late, counts.skipped};
  };
  EXPECT_EQ(run(1), run(1));
  EXPECT_NE(run(1), run(2));
}

TEST(Bus, CollidesWithAMotorThatStillSends) {
  // A host that does not wait for the end of an answer damages it.
  Rig rig({.ids = {1, 2}, .baud = 57'600, .return_delay = 0us});
  std::array<std::uint8_t, 10> ping{};
  ASSERT_EQ(encode({.id = 1, .instruction = Instruction::kPing}, ping), ping.size());
  rig.line.write(ping, kBegin, 57'600);
  rig.line.write(ping, kBegin + 2ms, 57'600);
  EXPECT_EQ(rig.line.counts().collisions, 1U);
}

TEST(Bus, DoesNotAllocateInACycle) {
  Rig rig;
  const std::vector<std::uint8_t> goals(36);
  const auto cycle = [&] {
    rig.bus.sync_read(rig.ids, kPresent, kPresentSize, rig.answers);
    static_cast<void>(rig.bus.sync_write(rig.ids, 116, 4, goals));
  };
  cycle();  // the emulated line gets its memory
  const trifinger::test::AllocationCounter allocations;
  for (int i = 0; i < 100; ++i) cycle();
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(Bus, RefusesOptionsThatMakeNoSense) {
  InertiaPlant plant(1);
  EmulatedBus line({{.id = 1}}, plant, kBegin);
  const auto port = [&] { return std::make_unique<EmulatedPort>(line, 1'000'000, kBegin); };
  EXPECT_THROW(Bus(nullptr), InvalidArgument);
  EXPECT_THROW(Bus(port(), {.slack = 0ns}), InvalidArgument);
  EXPECT_THROW(Bus(port(), {.return_delay = -1ns}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::dynamixel::test
