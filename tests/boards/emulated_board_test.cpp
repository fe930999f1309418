// SPDX-License-Identifier: BSD-3-Clause
#include "boards/emulated_board.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <variant>
#include <vector>

#include "can/position_unwrapper.hpp"
#include "support/allocation_counter.hpp"

namespace trifinger::boards::test {
namespace {

using can::BoardCommand;
using can::BoardError;
using can::BoardStatus;
using can::Command;
using can::DesiredCurrents;
using can::IndexPulse;
using can::MotorPair;
using std::chrono::milliseconds;

constexpr EmulatedBoardOptions kOptions{.alignment_time = milliseconds(5)};
constexpr double kCount = 1.0 / kOptions.encoder_counts;  // [revolutions]
constexpr MotorPair kNoCurrents{};

// A board on a test bench: time passes and rotors turn as the test says.
struct Bench {
  explicit Bench(const EmulatedBoardOptions& options = kOptions) : board(options) {}

  void switch_on() { board.switch_on(now, rotors); }
  void receive(const can::Frame& frame) {
    const trifinger::test::AllocationCounter counter;
    board.receive(frame, now);
    allocations += counter.count();
  }
  void send(Command command, std::int32_t value = 1) {
    receive(can::encode(BoardCommand{command, value}));
  }
  void send(const MotorPair& amperes) { receive(can::encode(DesiredCurrents{amperes})); }

  // One tick, and what the board has sent at it. The next tick is a millisecond later.
  std::vector<can::Frame> tick_frames() {
    const trifinger::test::AllocationCounter counter;
    const auto frames = board.tick(now, rotors, analog_inputs);
    allocations += counter.count();
    now += milliseconds(1);
    return {frames.begin(), frames.end()};
  }
  // The messages of that kind among what is sent at `count` ticks.
  template <class Message>
  std::vector<Message> hear(int count = 1) {
    std::vector<Message> heard;
    for (int i = 0; i < count; ++i) {
      for (const can::Frame& frame : tick_frames()) {
        const can::FromBoard any = can::decode_from_board(frame);
        if (const auto* const message = std::get_if<Message>(&any)) heard.push_back(*message);
      }
    }
    return heard;
  }
  void tick(int count = 1) {
    for (int i = 0; i < count; ++i) tick_frames();
  }

  EmulatedBoard board;
  Instant now{std::chrono::hours(1)};
  EmulatedBoard::Rotors rotors{};
  std::array<double, 2> analog_inputs{};
  std::size_t allocations{0};
};

// Starts a board like a host, until both motors are ready.
void start(Bench& bench) {
  bench.send(kNoCurrents);
  bench.send(Command::kEnableSystem);
  bench.send(Command::kEnableMotor1);
  bench.send(Command::kEnableMotor2);
  bench.tick(6);
}

Bench started_bench(const EmulatedBoardOptions& options = kOptions) {
  Bench bench(options);
  bench.switch_on();
  start(bench);
  return bench;
}

constexpr BoardStatus kPowerUpStatus{.system_enabled = true,
                                     .motors{{{.ready = true}, {.ready = true}}}};
constexpr BoardStatus kRunning{
    .system_enabled = true,
    .motors{{{.enabled = true, .ready = true}, {.enabled = true, .ready = true}}}};

BoardStatus stopped_by(BoardError error) {
  return {.motors{{{.ready = true}, {.ready = true}}}, .error = error};
}

// A random number from `low` up to but not including `high`. All are equally likely: without the
// size, rapidcheck begins with those next to `low`.
template <class Number>
Number between(Number low, Number high) {
  return *rc::gen::resize(rc::kNominalSize, rc::gen::inRange<Number>(low, high));
}

// How far `revolutions` is from zero if turning by `period` changes nothing.
double distance(double revolutions, double period) {
  return std::abs(std::remainder(revolutions, period));
}

constexpr double kRolloverPeriod = 2.0 * can::kRolloverRevolutions;

TEST(EmulatedBoard, SendsNothingButAStatusAtPowerUpAndEachSecondAfterIt) {
  Bench bench;
  bench.rotors = {RotorState{0.2, 1.0}, RotorState{0.5, -1.0}};
  bench.switch_on();
  for (int i = 0; i < 3000; ++i) {
    bench.rotors[0].revolutions += 0.1;
    const std::vector<can::Frame> frames = bench.tick_frames();
    ASSERT_EQ(frames.size(), i % 1000 == 0 ? 1U : 0U) << i;
    if (!frames.empty()) {
      ASSERT_TRUE(can::is_same_on_wire(frames[0], can::encode(kPowerUpStatus)));
    }
  }
}

TEST(EmulatedBoard, SendsOneStatusAfterSecondsWithoutATick) {
  Bench bench;
  bench.switch_on();
  EXPECT_EQ(bench.hear<BoardStatus>(1500).size(), 2U);
  bench.now += std::chrono::seconds(10);
  EXPECT_EQ(bench.hear<BoardStatus>(500).size(), 1U);
  EXPECT_EQ(bench.hear<BoardStatus>().size(), 1U) << "they stay at whole seconds";
}

TEST(EmulatedBoard, SendsAtEachTickTheDataThatAreSwitchedOn) {
  EXPECT_TRUE(rc::check([] {
    Bench bench;
    bench.switch_on();
    bench.tick();  // its status
    std::array<bool, 4> on{};
    const int steps = *rc::gen::inRange(0, 50);
    for (int step = 0; step < steps; ++step) {
      const auto data = between<std::size_t>(0, on.size() + 1);
      const int value = between(0, 2);
      if (data == on.size()) {
        bench.send(Command::kSendAll, value);
        on.fill(value != 0);
      } else {
        bench.send(static_cast<Command>(12 + data), value);
        on[data] = value != 0;
      }
      std::vector<std::uint32_t> wanted;
      for (std::size_t i = 0; i < on.size(); ++i) {
        if (on[i]) wanted.push_back(static_cast<std::uint32_t>(0x20 + 0x10 * i));
      }
      std::vector<std::uint32_t> sent;
      for (const can::Frame& frame : bench.tick_frames()) sent.push_back(frame.id);
      RC_ASSERT(sent == wanted);
    }
  }));
}

TEST(EmulatedBoard, SendsWhatItMeasures) {
  Bench bench = started_bench();
  bench.send(Command::kSendAll);
  bench.send({0.5, -0.25});
  bench.rotors = {RotorState{1.5, 2.0}, RotorState{-3.0, -0.125}};
  bench.analog_inputs = {0.25, 1.0};
  EXPECT_EQ(bench.hear<can::MotorCurrents>(), (std::vector{can::MotorCurrents{{0.5, -0.25}}}));
  EXPECT_EQ(bench.hear<can::MotorPositions>(), (std::vector{can::MotorPositions{{1.5, -3.0}}}));
  EXPECT_EQ(bench.hear<can::MotorVelocities>(), (std::vector{can::MotorVelocities{{2.0, -0.125}}}));
  EXPECT_EQ(bench.hear<can::AnalogInputs>(), (std::vector{can::AnalogInputs{{0.25, 1.0}}}));
}

TEST(EmulatedBoard, PositionsFollowTheRotorsToACountAndRollOver) {
  EXPECT_TRUE(rc::check([] {
    Bench bench;
    const auto revolutions = [](int limit) { return between(-limit, limit) / 1024.0; };
    for (RotorState& rotor : bench.rotors) rotor.revolutions = revolutions(1'000'000);
    const EmulatedBoard::Rotors start = bench.rotors;
    bench.switch_on();
    bench.send(Command::kSendPositions);
    std::array<can::PositionUnwrapper, 2> unwrappers;
    const int steps = *rc::gen::inRange(1, 100);
    for (int step = 0; step < steps; ++step) {
      const auto positions = bench.hear<can::MotorPositions>();
      RC_ASSERT(positions.size() == 1U);
      for (std::size_t i = 0; i < 2; ++i) {
        const double sent = positions[0].revolutions[i];
        const double turned = bench.rotors[i].revolutions - start[i].revolutions;
        RC_ASSERT((step > 0 || sent == 0.0));
        RC_ASSERT((sent >= -can::kRolloverRevolutions && sent < can::kRolloverRevolutions));
        RC_ASSERT(distance(sent - turned, kRolloverPeriod) < kCount);
        RC_ASSERT(std::abs(unwrappers[i].unwrap(sent) - turned) < kCount);
        RC_ASSERT(distance(sent, kCount) < 1e-7);
      }
      for (RotorState& rotor : bench.rotors) rotor.revolutions += revolutions(99 * 1024);
    }
  }));
}

TEST(EmulatedBoard, PositionsContinueAtTheOtherEndWhenTheyPass100Revolutions) {
  Bench bench;
  bench.switch_on();
  bench.send(Command::kSendPositions);
  const auto position_at = [&bench](double revolutions) {
    bench.rotors[0].revolutions = revolutions;
    return bench.hear<can::MotorPositions>()[0].revolutions[0];
  };
  EXPECT_EQ(position_at(99.75), 99.75);
  EXPECT_EQ(position_at(100.25), -99.75);
  EXPECT_EQ(position_at(99.75), 99.75);
  EXPECT_EQ(position_at(-99.75), -99.75);
  EXPECT_EQ(position_at(-100.25), 99.75);
  EXPECT_EQ(position_at(300.25), -99.75);
}

TEST(EmulatedBoard, GivesAnIndexPulseForEachPassOfAnIndexAndNoOther) {
  int pulses_heard = 0;
  EXPECT_TRUE(rc::check([&pulses_heard] {
    Bench bench;
    // The steps are such that rotors often stop exactly at the first index or a little before it.
    const auto revolutions = [](int limit) { return between(-limit, limit) / 64.0; };
    for (RotorState& rotor : bench.rotors) rotor.revolutions = revolutions(10'000);
    const EmulatedBoard::Rotors start = bench.rotors;
    bench.switch_on();
    bench.send(Command::kSendIndexPulses);
    RC_ASSERT(bench.hear<IndexPulse>().empty());
    const int steps = *rc::gen::inRange(1, 100);
    for (int step = 0; step < steps; ++step) {
      std::vector<IndexPulse> passes;
      for (std::size_t i = 0; i < 2; ++i) {
        const double place = kOptions.index_places[i];
        double& rotor = bench.rotors[i].revolutions;
        const double before = std::floor(rotor - place);
        rotor += revolutions(33);
        const double after = std::floor(rotor - place);
        // In steps of about half a revolution there is one pass or none.
        if (before == after) continue;
        passes.push_back({.motor = static_cast<std::uint8_t>(i),
                          .revolutions = std::max(before, after) + place - start[i].revolutions});
      }
      const auto pulses = bench.hear<IndexPulse>();
      RC_ASSERT(pulses.size() == passes.size());
      for (std::size_t i = 0; i < pulses.size(); ++i) {
        RC_ASSERT(pulses[i].motor == passes[i].motor);
        RC_ASSERT(distance(pulses[i].revolutions - passes[i].revolutions, kRolloverPeriod) <
                  kCount);
      }
      pulses_heard += static_cast<int>(pulses.size());
    }
  }));
  EXPECT_GT(pulses_heard, 0);
}

TEST(EmulatedBoard, AnIndexIsAtTheSamePositionInEachRevolutionAndDirection) {
  // No whole number of counts, so each revolution could round it differently.
  Bench bench({.index_places = {0.123456, 0.654321}, .encoder_counts = 4096});
  bench.rotors[0].revolutions = 0.111;
  bench.switch_on();
  bench.send(Command::kSendIndexPulses);
  std::vector<IndexPulse> pulses;
  for (int i = 0; i < 4000; ++i) {
    bench.rotors[0].revolutions += i < 2000 ? 0.0317 : -0.0317;
    for (const IndexPulse& pulse : bench.hear<IndexPulse>()) pulses.push_back(pulse);
  }
  ASSERT_EQ(pulses.size(), 128U);
  for (const IndexPulse& pulse : pulses) {
    EXPECT_LT(distance(pulse.revolutions - pulses[0].revolutions, 1.0), 1e-7);
    EXPECT_LT(distance(pulse.revolutions, 1.0 / 4096), 1e-7) << "a whole number of counts";
  }
}

TEST(EmulatedBoard, SendsOfSeveralIndexesInOneTickTheLast) {
  Bench bench;
  bench.switch_on();
  bench.send(Command::kSendIndexPulses);
  const auto pulses_at = [&bench](double revolutions) {
    bench.rotors[0].revolutions = revolutions;
    return bench.hear<IndexPulse>();
  };
  EXPECT_EQ(pulses_at(7.5), (std::vector{IndexPulse{.revolutions = 7.25}}));
  EXPECT_EQ(pulses_at(-7.0), (std::vector{IndexPulse{.revolutions = -6.75}}));
}

TEST(EmulatedBoard, IndexesPassedWhileNobodyAskedAreNotSentLater) {
  Bench bench;
  bench.switch_on();
  bench.rotors[0].revolutions = 0.5;
  bench.tick();
  bench.send(Command::kSendIndexPulses);
  EXPECT_TRUE(bench.hear<IndexPulse>(10).empty());
}

TEST(EmulatedBoard, DesiredCurrentsFlowFromTheNextTickOn) {
  Bench bench = started_bench();
  bench.send({0.5, -0.25});
  EXPECT_EQ(bench.board.currents(), kNoCurrents);
  bench.tick();
  EXPECT_EQ(bench.board.currents(), (MotorPair{0.5, -0.25}));
  bench.send(kNoCurrents);
  EXPECT_EQ(bench.board.currents(), (MotorPair{0.5, -0.25}));
  bench.tick();
  EXPECT_EQ(bench.board.currents(), kNoCurrents);
}

TEST(EmulatedBoard, DesiredCurrentsAreSaturatedAsFixedPointNumbers) {
  Bench bench = started_bench();
  bench.send({1e9, -1e9});
  bench.tick();
  EXPECT_EQ(bench.board.currents(), (MotorPair{128.0 - std::ldexp(1.0, -24), -128.0}));
}

TEST(EmulatedBoard, OnlyAnEnabledMotorGetsItsCurrent) {
  Bench bench = started_bench();
  bench.send({0.5, -0.25});
  bench.tick();
  bench.send(Command::kEnableMotor1, 0);
  EXPECT_EQ(bench.board.currents(), (MotorPair{0.0, -0.25})) << "it is switched off at once";
  bench.tick();
  EXPECT_EQ(bench.board.currents(), (MotorPair{0.0, -0.25}));
  bench.send(Command::kEnableMotor1);
  EXPECT_EQ(bench.board.currents(), (MotorPair{0.0, -0.25}));
  bench.tick();
  EXPECT_EQ(bench.board.currents(), (MotorPair{0.5, -0.25}));
}

TEST(EmulatedBoard, DisablingTheSystemDisablesTheMotorsAndForgetsTheCurrents) {
  Bench bench = started_bench();
  bench.send(Command::kSendAll);
  bench.send({0.5, -0.25});
  bench.tick();
  bench.send(Command::kEnableSystem, 0);
  EXPECT_EQ(bench.board.currents(), kNoCurrents);
  EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kNone));
  EXPECT_EQ(bench.hear<can::MotorCurrents>(1000).size(), 1000U) << "data are sent all the same";
  bench.send(Command::kEnableSystem);
  bench.tick();
  EXPECT_EQ(bench.board.status(), kPowerUpStatus);
  bench.send(Command::kEnableMotor1);
  bench.send(Command::kEnableMotor2);
  bench.tick();
  EXPECT_EQ(bench.board.status(), kRunning);
  EXPECT_EQ(bench.board.currents(), kNoCurrents);
}

TEST(EmulatedBoard, NoMotorIsEnabledWhileTheSystemIsNot) {
  Bench bench;
  bench.switch_on();
  bench.send(Command::kEnableSystem, 0);
  bench.send(Command::kEnableMotor1);
  EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kNone));
  bench.send(Command::kEnableSystem);
  EXPECT_EQ(bench.board.status(), kPowerUpStatus);
}

TEST(EmulatedBoard, EnablingASystemThatIsEnabledChangesNothing) {
  Bench bench = started_bench();
  bench.send({0.5, -0.25});
  bench.tick();
  bench.send(Command::kEnableSystem);
  bench.send(Command::kEnableMotor1);
  EXPECT_EQ(bench.board.status(), kRunning);
  EXPECT_EQ(bench.board.currents(), (MotorPair{0.5, -0.25}));
}

TEST(EmulatedBoard, BothMotorsAlignWhenTheyAreEnabledForTheFirstTime) {
  Bench bench;
  bench.switch_on();
  bench.send(Command::kEnableMotor1);
  bench.send(Command::kEnableMotor2);
  bench.send({0.5, -0.25});
  for (int i = 0; i < 5; ++i) {
    bench.tick();
    EXPECT_TRUE(bench.board.is_aligning(0) && bench.board.is_aligning(1)) << i;
    EXPECT_EQ(bench.board.status(), (BoardStatus{.system_enabled = true,
                                                 .motors{{{.enabled = true}, {.enabled = true}}}}));
    EXPECT_EQ(bench.board.currents(), kNoCurrents);
  }
  bench.tick();
  EXPECT_FALSE(bench.board.is_aligning(0) || bench.board.is_aligning(1));
  EXPECT_EQ(bench.board.status(), kRunning);
  EXPECT_EQ(bench.board.currents(), (MotorPair{0.5, -0.25}));
}

TEST(EmulatedBoard, AMotorAlignsOnceUntilTheSupplyIsSwitchedOff) {
  Bench bench = started_bench();
  bench.send(Command::kEnableSystem, 0);
  bench.tick(10);
  bench.send(Command::kEnableSystem);
  bench.send(Command::kEnableMotor1);
  EXPECT_FALSE(bench.board.is_aligning(0));
  bench.board.switch_off();
  EXPECT_FALSE(bench.board.is_aligning(0));
  bench.switch_on();
  EXPECT_FALSE(bench.board.is_aligning(0));
  bench.send(Command::kEnableMotor1);
  EXPECT_TRUE(bench.board.is_aligning(0));
}

TEST(EmulatedBoard, AnInterruptedAlignmentBeginsAgain) {
  Bench bench;
  bench.switch_on();
  bench.send(Command::kEnableMotor1);
  bench.tick(4);
  bench.send(Command::kEnableMotor1, 0);
  EXPECT_FALSE(bench.board.is_aligning(0));
  bench.tick(10);
  bench.send(Command::kEnableMotor1);
  bench.tick(5);
  EXPECT_TRUE(bench.board.is_aligning(0));
  bench.tick();
  EXPECT_FALSE(bench.board.is_aligning(0));
}

TEST(EmulatedBoard, EnablingAMotorThatAlignsChangesNothing) {
  Bench bench;
  bench.switch_on();
  for (int i = 0; i < 6; ++i) {
    bench.send(Command::kEnableMotor1);
    bench.tick();
  }
  EXPECT_FALSE(bench.board.is_aligning(0));
}

TEST(EmulatedBoard, StopsIfAndOnlyIfAnEnabledMotorHasACurrentOlderThanTheTimeLimit) {
  int stops = 0;
  EXPECT_TRUE(rc::check([&stops] {
    // Up to 0 it is off.
    const int limit = between(0, 4) == 0 ? between(-1, 1) : between(1, 20);  // [ms]
    const bool is_close = between(0, 2) == 0;
    const int silence = is_close ? std::max(limit + between(-1, 2), 0) : between(0, 40);
    Bench bench = started_bench();
    bench.send(Command::kSetReceiveTimeout, limit);
    MotorPair desired{};
    bool is_pushing = false;
    for (std::size_t i = 0; i < 2; ++i) {
      const bool enabled = *rc::gen::arbitrary<bool>();
      desired[i] = between(-1, 2);
      bench.send(i == 0 ? Command::kEnableMotor1 : Command::kEnableMotor2, enabled ? 1 : 0);
      is_pushing = is_pushing || (enabled && desired[i] != 0.0);
    }
    bench.send(desired);
    bench.tick(silence + 1);  // the first of them at once
    const bool stop = limit > 0 && is_pushing && silence > limit;
    RC_ASSERT(bench.board.status().error ==
              (stop ? BoardError::kReceiveTimeout : BoardError::kNone));
    RC_ASSERT(bench.board.status().system_enabled == !stop);
    RC_ASSERT((bench.board.currents() != kNoCurrents) == (is_pushing && !stop));
    stops += stop ? 1 : 0;
  }));
  EXPECT_GT(stops, 0);
}

// Stopped because the host was silent.
Bench silent_bench() {
  Bench bench = started_bench();
  bench.send(Command::kSetReceiveTimeout, 10);
  bench.send({0.5, 0.0});
  bench.tick(12);
  return bench;
}

TEST(EmulatedBoard, ATimeoutDisablesEverythingUntilTheHostStartsAgain) {
  Bench bench = silent_bench();
  EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kReceiveTimeout));
  EXPECT_EQ(bench.board.currents(), kNoCurrents);
  bench.send({0.5, 0.0});
  bench.send(Command::kEnableMotor1);
  bench.tick(100);
  EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kReceiveTimeout));
  start(bench);
  EXPECT_EQ(bench.board.status(), kRunning);
  bench.tick(100);
  EXPECT_EQ(bench.board.status(), kRunning);
}

TEST(EmulatedBoard, ATimeoutComesAgainIfTheHostDoesNotSendZeroCurrents) {
  Bench bench = silent_bench();
  bench.send(Command::kEnableSystem);
  bench.tick();
  EXPECT_EQ(bench.board.status(), kPowerUpStatus);
  bench.send(Command::kEnableMotor1);
  bench.tick();
  EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kReceiveTimeout));
}

TEST(EmulatedBoard, AnErrorStopsItAtOnceAndAnyButTheEncodersPasses) {
  for (unsigned code = 1; code < 8; ++code) {
    const auto error = static_cast<BoardError>(code);
    Bench bench = started_bench();
    bench.send({0.5, -0.25});
    bench.tick();
    bench.board.fail(error);
    EXPECT_EQ(bench.board.currents(), kNoCurrents);
    EXPECT_EQ(bench.board.status(), stopped_by(error));
    bench.tick(10);
    EXPECT_EQ(bench.board.status(), stopped_by(error));
    start(bench);
    EXPECT_EQ(bench.board.status(), error == BoardError::kEncoder ? stopped_by(error) : kRunning);
  }
}

TEST(EmulatedBoard, NoErrorIsNoReasonToStop) {
  Bench bench = started_bench();
  bench.board.fail(BoardError::kNone);
  EXPECT_EQ(bench.board.status(), kRunning);
}

TEST(EmulatedBoard, ABadEncoderStopsItAgainUntilTheSupplyIsSwitchedOff) {
  Bench bench;
  bench.switch_on();
  bench.send(Command::kEnableSystem, 0);
  bench.board.fail(BoardError::kEncoder);
  bench.tick();
  EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kNone)) << "it does not look for errors";
  for (int i = 0; i < 3; ++i) {
    bench.send(Command::kEnableSystem);
    EXPECT_EQ(bench.board.status(), kPowerUpStatus);
    bench.tick();
    EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kEncoder));
  }
  bench.board.switch_off();
  bench.switch_on();
  start(bench);
  EXPECT_EQ(bench.board.status(), kRunning);
}

TEST(EmulatedBoard, AStoppedBoardKeepsItsFirstError) {
  Bench bench = silent_bench();
  bench.board.fail(BoardError::kOther);
  bench.board.fail(BoardError::kEncoder);
  bench.tick(10);
  EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kReceiveTimeout));
  bench.send(Command::kEnableSystem, 0);
  EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kReceiveTimeout));
}

TEST(EmulatedBoard, ARolloverIsAnErrorOnlyIfTheHostSaysSo) {
  for (const auto& [motor, revolutions] : {std::pair{0U, 100.5}, std::pair{1U, -100.5}}) {
    Bench bench = started_bench();
    double& rotor = bench.rotors[motor].revolutions;
    rotor = revolutions;
    bench.tick();
    EXPECT_EQ(bench.board.status(), kRunning);
    bench.send(Command::kEnableRolloverError);
    bench.tick();
    EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kRollover));
    start(bench);
    EXPECT_EQ(bench.board.status(), stopped_by(BoardError::kRollover)) << "it is still there";
    rotor = 0.0;
    start(bench);
    EXPECT_EQ(bench.board.status(), kRunning);
    rotor = revolutions;
    bench.send(Command::kEnableRolloverError, 0);
    bench.tick();
    EXPECT_EQ(bench.board.status(), kRunning);
  }
}

TEST(EmulatedBoard, WithoutItsSupplyItIsSilentAndForgetsEverything) {
  Bench bench;
  bench.tick();
  EXPECT_FALSE(bench.board.is_on());
  bench.switch_on();
  start(bench);
  bench.send(Command::kSendAll);
  bench.send(Command::kSetReceiveTimeout, 1);
  bench.send({0.5, -0.25});
  bench.tick();
  bench.rotors = {RotorState{3.3}, RotorState{-200.7}};
  bench.board.switch_off();
  EXPECT_FALSE(bench.board.is_on());
  EXPECT_EQ(bench.board.currents(), kNoCurrents);
  EXPECT_EQ(bench.board.status(), BoardStatus{});
  bench.send(Command::kEnableSystem, 0);
  bench.send({0.5, -0.25});
  bench.board.fail(BoardError::kEncoder);
  for (int i = 0; i < 2000; ++i) ASSERT_TRUE(bench.tick_frames().empty());

  bench.switch_on();
  const std::vector<can::Frame> frames = bench.tick_frames();
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_TRUE(can::is_same_on_wire(frames[0], can::encode(kPowerUpStatus)));
  start(bench);
  bench.tick(10);
  EXPECT_EQ(bench.board.status(), kRunning);
  EXPECT_EQ(bench.board.currents(), kNoCurrents);
  bench.send(Command::kSendPositions);
  EXPECT_EQ(bench.hear<can::MotorPositions>(), std::vector{can::MotorPositions{}});
}

TEST(EmulatedBoard, SwitchingItOnTwiceChangesNothing) {
  Bench bench = started_bench();
  bench.rotors[0].revolutions = 1.5;
  bench.switch_on();
  EXPECT_EQ(bench.board.status(), kRunning);
  bench.send(Command::kSendPositions);
  EXPECT_EQ(bench.hear<can::MotorPositions>(), (std::vector{can::MotorPositions{{1.5, 0.0}}}));
}

TEST(EmulatedBoard, NoiseHasTheGivenDeviationAndDependsOnlyOnTheSeed) {
  const auto heard = [](const EmulatedBoardOptions& options) {
    Bench bench = started_bench(options);
    bench.send(Command::kSendAll);
    bench.send({0.5, 0.5});
    bench.rotors = {RotorState{0.0, -2.0}, RotorState{0.0, -2.0}};
    std::array<std::vector<double>, 2> values;  // currents, velocities
    for (int i = 0; i < 2000; ++i) {
      for (const can::Frame& frame : bench.tick_frames()) {
        const can::FromBoard message = can::decode_from_board(frame);
        if (const auto* const currents = std::get_if<can::MotorCurrents>(&message)) {
          values[0].insert(values[0].end(), currents->amperes.begin(), currents->amperes.end());
        } else if (const auto* const velocities = std::get_if<can::MotorVelocities>(&message)) {
          values[1].insert(values[1].end(), velocities->kilo_rpm.begin(),
                           velocities->kilo_rpm.end());
        }
      }
    }
    return values;
  };
  const EmulatedBoardOptions options{
      .alignment_time = milliseconds(5), .current_noise = 0.1, .velocity_noise = 0.3, .seed = 1};
  const auto values = heard(options);
  const auto expect = [](const std::vector<double>& some, double mean, double deviation) {
    ASSERT_EQ(some.size(), 4000U);
    double sum = 0.0;
    double squares = 0.0;
    for (const double value : some) {
      sum += value - mean;
      squares += (value - mean) * (value - mean);
    }
    EXPECT_NEAR(sum / 4000.0, 0.0, 0.1 * deviation);
    EXPECT_NEAR(std::sqrt(squares / 4000.0), deviation, 0.1 * deviation);
  };
  expect(values[0], 0.5, 0.1);
  expect(values[1], -2.0, 0.3);
  EXPECT_EQ(heard(options), values);
  EmulatedBoardOptions other = options;
  other.seed = 2;
  EXPECT_NE(heard(other), values);
}

TEST(EmulatedBoard, AllocatesNothing) {
  Bench bench = started_bench({.current_noise = 0.1, .velocity_noise = 0.1});
  bench.send(Command::kSendAll);
  for (int i = 0; i < 2000; ++i) {
    bench.rotors[0].revolutions += 0.3;
    bench.tick();
  }
  EXPECT_EQ(bench.allocations, 0U);
}

TEST(EmulatedBoard, FramesThatNoHostSendsHaveNoEffect) {
  int ignored = 0;
  EXPECT_TRUE(rc::check([&ignored] {
    const auto small = [] { return between<std::uint8_t>(0, 33); };
    Bench disturbed = started_bench();
    disturbed.send(Command::kSendAll);
    disturbed.send({0.5, -0.25});
    Bench quiet = disturbed;
    const int steps = *rc::gen::inRange(0, 50);
    for (int step = 0; step < steps; ++step) {
      can::Frame frame{
          .id = *rc::gen::element<std::uint32_t>(0, 5, 6, 0x10, 0x20, 0x30, 0x60, 0x100),
          .dlc = *rc::gen::element<std::uint8_t>(0, 1, 5, 8, 8, 8, 9)};
      frame.data = {small(), 0, 0, small(), 0, 0, 0, small()};
      if (std::holds_alternative<can::Rejection>(can::decode_from_host(frame))) {
        disturbed.receive(frame);
        ++ignored;
      }
      RC_ASSERT(disturbed.board.status() == quiet.board.status());
      RC_ASSERT(disturbed.board.currents() == quiet.board.currents());
      const auto frames = disturbed.tick_frames();
      RC_ASSERT(std::ranges::equal(frames, quiet.tick_frames(), can::is_same_on_wire));
    }
  }));
  EXPECT_GT(ignored, 0);
}

TEST(EmulatedBoard, SurvivesRotorsThatAreNowhere) {
  for (const double nowhere : {std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::infinity(), 1e300, -1e300}) {
    Bench bench = started_bench();
    bench.send(Command::kSendAll);
    bench.rotors[0] = {nowhere, nowhere};
    bench.tick(3);
    bench.rotors[0] = {1.5, 0.0};
    EXPECT_EQ(bench.hear<can::MotorPositions>(), (std::vector{can::MotorPositions{{1.5, 0.0}}}));
  }
}

// What may be seen of a board in any state, whatever hosts and people do to it.
class Watch {
 public:
  explicit Watch(Bench& bench) : bench_(bench) {}

  void receive(const can::Frame& frame) {
    const can::FromHost message = can::decode_from_host(frame);
    if (const auto* const command = std::get_if<BoardCommand>(&message)) {
      may_start_ = command->command == Command::kEnableSystem && command->value != 0;
    } else if (const auto* const currents = std::get_if<DesiredCurrents>(&message)) {
      desired_ = currents->amperes;
    }
    bench_.receive(frame);
    look();
  }
  void tick() {
    const bool is_status_due = bench_.board.is_on() && ticks_++ % 1000 == 0;
    const std::vector<can::Frame> frames = bench_.tick_frames();
    RC_ASSERT((bench_.board.is_on() || frames.empty()));
    std::size_t statuses = 0;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      RC_ASSERT((i == 0 || frames[i - 1].id <= frames[i].id));
      const can::FromBoard message = can::decode_from_board(frames[i]);
      RC_ASSERT(!std::holds_alternative<can::Rejection>(message));
      if (const auto* const status = std::get_if<BoardStatus>(&message)) {
        RC_ASSERT(*status == bench_.board.status());
        ++statuses;
      }
    }
    RC_ASSERT(statuses == (is_status_due ? 1U : 0U));
    look();
  }
  void fail(BoardError error) {
    bench_.board.fail(error);
    look();
  }
  void switch_supply(bool on) {
    if (!on) bench_.board.switch_off();
    if (on && !bench_.board.is_on()) {
      bench_.switch_on();
      ticks_ = 0;
      may_start_ = true;
      was_aligned_ = {};
    }
    look();
  }

  [[nodiscard]] bool has_seen_currents() const { return has_seen_currents_; }

 private:
  void look() {
    const BoardStatus status = bench_.board.status();
    if (!bench_.board.is_on()) RC_ASSERT(status == BoardStatus{});
    RC_ASSERT((status.error == BoardError::kNone || !status.system_enabled));
    // Only a host enables the system again, and only it clears an error.
    if (bench_.board.is_on() && !may_start_) {
      RC_ASSERT((last_.system_enabled || !status.system_enabled));
      RC_ASSERT((last_.error == BoardError::kNone || status.error == last_.error));
    }
    for (std::size_t i = 0; i < 2; ++i) {
      const auto [enabled, ready] = status.motors[i];
      const double current = bench_.board.currents()[i];
      RC_ASSERT((!enabled || status.system_enabled));
      RC_ASSERT(bench_.board.is_aligning(i) == (enabled && !ready));
      RC_ASSERT((current == 0.0 || (enabled && ready)));
      // At a tick it becomes what is desired; until then it is that or what was before.
      RC_ASSERT((current == 0.0 || current == desired_[i] || current == last_currents_[i]));
      if (bench_.board.is_on()) was_aligned_[i] = was_aligned_[i] || (enabled && ready);
      RC_ASSERT(!(was_aligned_[i] && bench_.board.is_aligning(i)));
      has_seen_currents_ = has_seen_currents_ || current != 0.0;
    }
    last_ = status;
    last_currents_ = bench_.board.currents();
    may_start_ = false;
    RC_ASSERT(bench_.allocations == 0U);
  }

  Bench& bench_;
  MotorPair desired_{};
  MotorPair last_currents_{};
  BoardStatus last_{};
  std::array<bool, 2> was_aligned_{};
  bool may_start_{false};  // the system, by the last event
  bool has_seen_currents_{false};
  int ticks_{0};  // since the supply was switched on
};

can::Frame random_host_frame() {
  constexpr std::array kCommands{
      Command::kEnableMotor1,      Command::kEnableMotor2,        Command::kEnableSystem,
      Command::kSendCurrents,      Command::kSendPositions,       Command::kSendVelocities,
      Command::kSendAnalogInputs,  Command::kSendIndexPulses,     Command::kSendAll,
      Command::kSetReceiveTimeout, Command::kEnableRolloverError, Command::kEnableSpring1};
  if (between(0, 3) == 0) {
    const auto amperes = [] { return 0.5 * between(-2, 3); };
    return can::encode(DesiredCurrents{{amperes(), amperes()}});
  }
  // What enables something is as frequent as all the rest, or few boards would ever run.
  const bool enable = between(0, 2) == 0;
  const Command command = kCommands[between<std::size_t>(0, enable ? 3 : kCommands.size())];
  const std::int32_t value = *rc::gen::weightedElement<std::int32_t>({{3, 0}, {8, 1}, {1, 20}});
  return can::encode(BoardCommand{command, value});
}

TEST(EmulatedBoard, NoCurrentEverFlowsUnlessEnabledAndReadyWhateverHappensToIt) {
  int with_currents = 0;
  EXPECT_TRUE(rc::check([&with_currents] {
    Bench bench;
    Watch watch(bench);
    watch.switch_supply(true);
    const int events = *rc::gen::inRange(0, 200);
    for (int event = 0; event < events; ++event) {
      const int kind = between(0, 40);
      if (kind == 0) {
        watch.switch_supply(between(0, 3) > 0);
      } else if (kind == 1) {
        watch.fail(static_cast<BoardError>(between(0, 8)));
      } else if (kind < 20) {
        watch.receive(random_host_frame());
      } else {
        const double speed = 0.1 * between(-10, 11);  // [revolutions/ms]
        const int ticks = between(1, 40);
        for (int i = 0; i < ticks; ++i) {
          bench.rotors[0].revolutions += speed;
          bench.rotors[1].revolutions -= 0.3 * speed;
          watch.tick();
        }
      }
    }
    with_currents += watch.has_seen_currents() ? 1 : 0;
  }));
  EXPECT_GT(with_currents, 10) << "of 100 boards";
}

}  // namespace
}  // namespace trifinger::boards::test
