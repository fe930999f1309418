// SPDX-License-Identifier: BSD-3-Clause
#include "boards/board_robot.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "rig.hpp"
#include "support/allocation_counter.hpp"
#include "support/message_of.hpp"

namespace trifinger::boards::test {
namespace {

using namespace std::chrono_literals;
using trifinger::test::AllocationCounter;
using trifinger::test::message_of;
using State = DriverReport::State;

constexpr double kTolerance = 0.005;  // [rad]

template <class R>
std::string text_of(const Rig<R>& rig, const DriverReport& report) {
  return std::string(rig.robot->fault_text(report.fault_code));
}

template <class R>
::testing::AssertionResult is_prepared(Rig<R>& rig) {
  const DriverReport report = rig.prepare();
  if (report.state == State::kReady) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure()
         << (report.state == State::kBusy ? "it takes too long" : text_of(rig, report));
}

// Steps until the report is a fault; returns the number of milliseconds, or -1.
template <class R>
int time_to_fault(Rig<R>& rig, const typename R::Action& action, std::string& text) {
  for (int ms = 1; ms <= 2000; ++ms) {
    const DriverReport report = rig.step(action);
    if (report.state != State::kFault) continue;
    text = text_of(rig, report);
    for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) rig.pass();
    return ms;
  }
  return -1;
}

template <class R>
void expect_true_positions(const Rig<R>& rig) {
  const auto truth = rig.joints.position();
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    EXPECT_NEAR(rig.observation.position[i], truth[i], kTolerance) << "joint " << i;
  }
}

template <class R>
typename R::Action hold_at(double position) {
  JointVector<R::kJoints> positions{};
  positions.fill(position);
  return R::Action::of_position(positions);
}

// ---- homing ----

class Homing : public ::testing::TestWithParam<HomingMethod> {};

TEST_P(Homing, FindsTheSameZeroFromEveryPose) {
  auto options = options_of_tests<TriFinger>();
  set_method(options, GetParam());
  // The calibration: one homing tells where the home is.
  {
    Rig<TriFinger> rig(options);
    ASSERT_TRUE(is_prepared(rig));
    rig.pass();
    static_cast<void>(rig.robot->get_latest_observation(&rig.observation));
    const auto truth = rig.joints.position();
    for (std::size_t i = 0; i < 9; ++i) {
      options.motors[i].homing.home_position += truth[i] - rig.observation.position[i];
    }
  }
  std::mt19937 random(7);
  std::uniform_real_distribution<double> pose(-2.0, 2.0);
  for (int run = 0; run < 34; ++run) {
    JointVector<9> start{};
    for (double& angle : start) angle = pose(random);
    Rig<TriFinger> rig(options, start);
    ASSERT_EQ(rig.prepare().state, State::kReady) << "run " << run;
    ASSERT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
    expect_true_positions(rig);
  }
}

INSTANTIATE_TEST_SUITE_P(AtAnEndStop, Homing,
                         ::testing::Values(HomingMethod::kEndStopIndex, HomingMethod::kEndStop,
                                           HomingMethod::kReleasedEndStop));

TEST(BoardRobot, TakesTheNextIndexOrThePlaceWhereItStandsAsItsHome) {
  auto options = options_of_tests<OneJoint>();
  set_method(options, HomingMethod::kHere);
  options.motors[0].homing.home_position = 0.7;
  Rig<OneJoint> here(options, {0.7});
  here.joints.weight = 0.0;
  ASSERT_TRUE(is_prepared(here));
  ASSERT_EQ(here.step(hold_at<OneJoint>(0.3)).state, State::kReady);
  EXPECT_NEAR(here.observation.position[0], here.joints.position()[0], kTolerance);

  set_method(options, HomingMethod::kNextIndex);
  options.motors[0].homing.home_position =
      0.25 * 2 * std::numbers::pi / 9;  // Where its encoder has it.
  Rig<OneJoint> next(options, {0.0});
  ASSERT_TRUE(is_prepared(next));
  ASSERT_EQ(next.step(hold_at<OneJoint>(0.3)).state, State::kReady);
  EXPECT_NEAR(next.observation.position[0], next.joints.position()[0], kTolerance);
}

TEST(BoardRobot, fault_49_TakesNothingForAnEndStopThatAJointLeansOn) {
  for (const HomingMethod method :
       {HomingMethod::kEndStop, HomingMethod::kEndStopIndex, HomingMethod::kReleasedEndStop}) {
    auto options = options_of_tests<TriFinger>();
    set_method(options, method);
    JointVector<9> expected{};
    for (const bool leans : {false, true}) {
      Rig<TriFinger> rig(options, {0.7});
      if (leans) rig.joints.leans_at = 0.7;
      ASSERT_TRUE(is_prepared(rig));
      ASSERT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
      JointVector<9> errors = rig.observation.position;
      for (std::size_t i = 0; i < 9; ++i) errors[i] -= rig.joints.position()[i];
      if (!leans) expected = errors;
      for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(errors[i], expected[i], kTolerance);
    }
  }
}

TEST(BoardRobot, fault_49_SaysWhichJointRestsElsewhereEachTime) {
  Rig<OneJoint> rig;
  DriverReport report = DriverReport::busy();
  for (TimeIndex step = 0; step < 60'000 && report.state == State::kBusy; ++step) {
    // What it leans on moves while the joint is away.
    if (rig.joints.velocity()[0] < -0.3) rig.joints.upper_stop -= 2e-4;
    rig.pass();
    report = rig.robot->prepare(step);
  }
  ASSERT_EQ(report.state, State::kFault);
  EXPECT_NE(text_of(rig, report).find("joint 0 comes to rest at another place"), std::string::npos)
      << text_of(rig, report);
  EXPECT_FALSE(rig.robot->is_homed());
}

TEST(BoardRobot, fault_49_SaysWhichJointHasNoEndStopAndLetsGo) {
  auto options = options_of_tests<TwoJoints>();
  options.max_travel = 3.0;
  Rig<TwoJoints> rig(options);
  rig.joints.upper_stop = 100.0;
  const DriverReport report = rig.prepare();
  ASSERT_EQ(report.state, State::kFault);
  EXPECT_NE(text_of(rig, report).find("did not find its end stop"), std::string::npos)
      << text_of(rig, report);
  EXPECT_FALSE(rig.robot->is_homed());
  for (int i = 0; i < 5; ++i) rig.pass();
  EXPECT_EQ(rig.emulator->board(0).currents(), (can::MotorPair{}));
}

TEST(BoardRobot, fault_49_HomingNeverGivesMoreThanTheMotorsCarryForEver) {
  auto options = options_of_tests<OneJoint>();
  options.motors[0].homing.torque = 0.1;
  Rig<OneJoint> rig(options);
  double largest = 0.0;
  DriverReport report = DriverReport::busy();
  const double ampere = options.motors[0].torque_per_ampere();
  bool has_pushed = false;
  for (TimeIndex step = 0; step < 20'000 && report.state == State::kBusy; ++step) {
    rig.pass();
    report = rig.robot->prepare(step);
    largest = std::max(largest, std::abs(ampere * rig.emulator->board(0).currents()[0]));
    has_pushed |= largest > 0.05;
  }
  EXPECT_EQ(report.state, State::kReady);
  EXPECT_TRUE(has_pushed);
  EXPECT_LE(largest, options.limits[0].continuous_torque + 1e-6);
}

// ---- actions ----

TEST(BoardRobot, AppliesTheTorqueThatIsAskedForAndMeasuresIt) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  TriFinger::Action action;
  for (std::size_t i = 0; i < 9; ++i) action.torque[i] = 0.01 * static_cast<double>(i) - 0.04;
  for (int i = 0; i < 20; ++i) ASSERT_EQ(rig.step(action).state, State::kReady);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(rig.observation.torque[i], rig.applied.torque[i], 0.01) << "joint " << i;
  }
}

TEST(BoardRobot, PolarityTurnsCurrentsAndPositions) {
  auto options = options_of_tests<TwoJoints>();
  set_method(options, HomingMethod::kHere);
  set_home_position(options, 0.0);
  options.motors[1].polarity = -1.0;
  Rig<TwoJoints> rig(options);
  rig.joints.weight = 0.0;
  ASSERT_TRUE(is_prepared(rig));
  for (int i = 0; i < 500; ++i) ASSERT_EQ(rig.step(hold_at<TwoJoints>(0.5)).state, State::kReady);
  expect_true_positions(rig);
  EXPECT_NEAR(rig.joints.position()[1], 0.5, 0.05);
}

TEST(BoardRobot, NoMotorEverGetsMoreThanTheLargestCurrent) {
  auto options = options_of_tests<TwoJoints>();
  set_method(options, HomingMethod::kHere);
  set_home_position(options, 0.0);
  options.initial_position.assign(2, 0.0);
  options.max_current = 0.1;
  Rig<TwoJoints> rig(options);
  rig.joints.weight = 0.0;
  ASSERT_TRUE(is_prepared(rig));
  TwoJoints::Action action;
  action.torque = {0.36, -0.36};
  for (int i = 0; i < 50; ++i) {
    static_cast<void>(rig.step(action));
    for (const double current : rig.emulator->board(0).currents()) {
      EXPECT_LE(std::abs(current), 0.1 + 1e-6);
    }
  }
  // The applied action says so, too.
  EXPECT_LE(std::abs(rig.applied.torque[0]), 0.1 * 0.18 + 1e-9);
  EXPECT_NE(rig.applied.reasons[0], 0U);
}

TEST(BoardRobot, DoesNotAllocateInTheLoop) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  const AllocationCounter counter;
  for (int i = 0; i < 100; ++i) static_cast<void>(rig.step(hold_at<TriFinger>(0.3)));
  rig.emulator->set_power(3, false, rig.clock.now());
  for (int i = 0; i < 20; ++i) static_cast<void>(rig.step(hold_at<TriFinger>(0.3)));
  for (TimeIndex i = 0; i < 200; ++i) static_cast<void>(rig.robot->stop(i));
  EXPECT_EQ(counter.count(), 0U);
}

TEST(BoardRobot, ASecondSessionNeedsNoHoming) {
  Rig<Finger> rig;
  ASSERT_TRUE(is_prepared(rig));
  for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) rig.pass();
  for (int i = 0; i < 200; ++i) rig.pass();  // Nobody sends anything in between.
  EXPECT_EQ(rig.prepare(5).state, State::kReady);
  ASSERT_EQ(rig.step(hold_at<Finger>(0.3)).state, State::kReady);
  expect_true_positions(rig);
}

// A joint falls further in a pause than a motor could turn from one message to the next, while the
// other joint of its board stays.
TEST(BoardRobot, AfterAPauseItWaitsForTheNewPositionOfEveryMotor) {
  Rig<TwoJoints> rig;
  rig.joints.weight = 0.0;
  rig.joints.friction = 0.02;
  ASSERT_TRUE(is_prepared(rig));
  for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) rig.pass();
  rig.joints.push[1] = 0.05;
  while (rig.joints.position()[1] < 1.0) rig.pass();
  rig.joints.push[1] = 0.0;
  for (int i = 0; i < 500; ++i) rig.pass();
  ASSERT_TRUE(is_prepared(rig));
  for (int i = 0; i < 10; ++i) {
    ASSERT_EQ(rig.step(hold_at<TwoJoints>(kNotGiven)).state, State::kReady);
    expect_true_positions(rig);
  }
}

TEST(BoardRobot, fault_12_BeyondAHardLimitItHomesAgainWhereThatLeadsToAnEndStop) {
  for (const HomingMethod method : {HomingMethod::kEndStop, HomingMethod::kHere}) {
    auto options = options_of_tests<Finger>();
    set_method(options, method);
    if (method == HomingMethod::kHere) set_home_position(options, 0.0);
    Rig<Finger> rig(options);
    ASSERT_TRUE(is_prepared(rig));
    rig.joints.push[1] = 1.0;
    std::string text;
    ASSERT_GT(time_to_fault(rig, hold_at<Finger>(0.3), text), 0);
    EXPECT_NE(text.find("joint 1 is beyond its hard limit"), std::string::npos) << text;
    EXPECT_EQ(rig.robot->is_homed(), method == HomingMethod::kHere);
    rig.joints.push[1] = 0.0;
    ASSERT_TRUE(is_prepared(rig));
  }
}

// ---- faults ----

TEST(BoardRobot, fault_42_ASilentBoardIsFoundWithin5msAndNamed) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  ASSERT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
  rig.emulator->set_power(3, false, rig.clock.now());
  std::string text;
  const int ms = time_to_fault(rig, hold_at<TriFinger>(0.3), text);
  EXPECT_GE(ms, 1);
  EXPECT_LE(ms, 6);  // 5 ms after the last message
  EXPECT_EQ(text,
            "board 3 (can3, joint 3): no measurements come; check its supply and its cable, then "
            "recover");
}

TEST(BoardRobot, fault_40_AnInterfaceThatIsDownIsFoundWithin2msAndRecovers) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  const Instant now = rig.clock.now();
  rig.buses[2]->add({.kind = can::BusFault::Kind::kDown, .begin = now, .end = now + 100ms});
  std::string text;
  const int ms = time_to_fault(rig, hold_at<TriFinger>(0.3), text);
  EXPECT_GE(ms, 1);
  EXPECT_LE(ms, 2);
  EXPECT_NE(text.find("board 2 (can2, joints 4 and 5): its CAN interface is down"),
            std::string::npos)
      << text;
  for (int i = 0; i < 200; ++i) rig.pass();
  ASSERT_TRUE(is_prepared(rig));
  EXPECT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
  expect_true_positions(rig);
}

// The message that the link is up again may come after the recovery has begun.
TEST(BoardRobot, fault_40_ALinkMayBeUpShortlyAfterTheRecoveryHasBegun) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  const Instant now = rig.clock.now();
  const Instant end = now + 100ms;
  rig.buses[3]->add({.kind = can::BusFault::Kind::kBusOff, .begin = now, .end = end});
  std::string text;
  time_to_fault(rig, hold_at<TriFinger>(0.3), text);
  EXPECT_NE(text.find("board 3 (can3, joint 3): the CAN controller has left"), std::string::npos)
      << text;
  while (rig.clock.now() < end - 3ms) rig.pass();
  ASSERT_TRUE(is_prepared(rig));
  EXPECT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
}

TEST(BoardRobot, fault_40_ALinkThatStaysDownIsNamedByTheRecovery) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  rig.buses[3]->add({.kind = can::BusFault::Kind::kDown, .begin = rig.clock.now()});
  std::string text;
  time_to_fault(rig, hold_at<TriFinger>(0.3), text);
  const DriverReport report = rig.prepare();
  EXPECT_EQ(report.state, State::kFault);
  text = text_of(rig, report);
  EXPECT_NE(text.find("its CAN interface is down"), std::string::npos) << text;
}

TEST(BoardRobot, fault_44_EveryErrorOfABoardIsNamedWithItsRemedy) {
  for (int code = 1; code < 8; ++code) {
    const auto error = static_cast<can::BoardError>(code);
    Rig<TriFinger> rig;
    ASSERT_TRUE(is_prepared(rig));
    ASSERT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
    rig.emulator->board(4).fail(error);
    std::string text;
    const int ms = time_to_fault(rig, hold_at<TriFinger>(0.3), text);
    EXPECT_GE(ms, 1) << code;
    EXPECT_NE(text.find("board 4 (can4"), std::string::npos) << text;
    // With current the fault comes at once and may be seen as a motor without current; the next
    // status says more.
    const bool is_named = text.find(can::text_of(error).sentence) != std::string::npos ||
                          text.find("gets no current") != std::string::npos;
    EXPECT_TRUE(is_named) << text;
  }
}

TEST(BoardRobot, fault_44_AnErrorIsFoundWithin10msWhileCurrentFlows) {
  Rig<OneJoint> rig;
  ASSERT_TRUE(is_prepared(rig));
  rig.joints.is_blocked = true;
  OneJoint::Action action;
  action.torque[0] = 0.1;
  for (int i = 0; i < 50; ++i) ASSERT_EQ(rig.step(action).state, State::kReady);
  rig.emulator->board(0).fail(can::BoardError::kOther);
  std::string text;
  const int ms = time_to_fault(rig, action, text);
  EXPECT_GE(ms, 1);
  EXPECT_LE(ms, 10) << text;
}

TEST(BoardRobot, fault_43_ABoardThatRestartsMakesTheRobotHomeAgain) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  ASSERT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
  // The supply returns before anybody can call it silent.
  rig.emulator->set_power(0, false, rig.clock.now());
  rig.pass();
  rig.emulator->set_power(0, true, rig.clock.now());
  std::string text;
  EXPECT_GE(time_to_fault(rig, hold_at<TriFinger>(0.3), text), 1);
  EXPECT_NE(text.find("board 0"), std::string::npos) << text;
  EXPECT_FALSE(rig.robot->is_homed());
  ASSERT_TRUE(is_prepared(rig));
  ASSERT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
  expect_true_positions(rig);
}

TEST(BoardRobot, fault_48_AfterAnEmergencyStopTheRobotRecovers) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  rig.emulator->set_power(false, rig.clock.now());
  std::string text;
  const int ms = time_to_fault(rig, hold_at<TriFinger>(0.3), text);
  EXPECT_GE(ms, 1);
  EXPECT_LE(ms, 6);
  EXPECT_NE(text.find("board 0"), std::string::npos) << text;
  for (int i = 0; i < 300; ++i) rig.pass();
  rig.emulator->set_power(true, rig.clock.now());
  ASSERT_TRUE(is_prepared(rig));
  ASSERT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady);
  expect_true_positions(rig);
}

TEST(BoardRobot, WithoutBoardsItSaysSoAfterTheirTime) {
  auto options = options_of_tests<OneJoint>();
  options.board.start_timeout = 500ms;
  Rig<OneJoint> rig(options);
  rig.emulator->set_power(false, rig.clock.now());
  const DriverReport report = rig.prepare();
  EXPECT_EQ(report.state, State::kFault);
  EXPECT_NE(text_of(rig, report).find("board 0 (can0, joint 0): it did not become ready"),
            std::string::npos)
      << text_of(rig, report);
}

TEST(BoardRobot, fault_37_LostFramesAreCountedAndTheRobotGoesOn) {
  for (const double probability : {1e-3, 1e-2, 5e-2}) {
    Rig<TriFinger> rig;
    ASSERT_TRUE(is_prepared(rig));
    for (const auto& bus : rig.buses) {
      bus->add({.kind = can::BusFault::Kind::kLose, .probability = probability, .node = 1});
    }
    std::uint32_t lost = 0;
    for (int i = 0; i < 3000; ++i) {
      const DriverReport report = rig.step(hold_at<TriFinger>(0.3));
      ASSERT_EQ(report.state, State::kReady) << text_of(rig, report);
      EXPECT_GE(report.lost_frames, lost);
      lost = report.lost_frames;
    }
    EXPECT_GT(lost, 0U);
    EXPECT_NEAR(lost, 6 * 3000 * probability, 6 * std::sqrt(6 * 3000 * probability));
    expect_true_positions(rig);
  }
}

TEST(BoardRobot, fault_38_DuplicatesAndLateFramesChangeNothing) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  for (const auto& bus : rig.buses) {
    bus->add({.kind = can::BusFault::Kind::kDuplicate, .probability = 0.2, .node = 1});
    bus->add({.kind = can::BusFault::Kind::kDelay, .probability = 0.1, .node = 1, .delay = 3ms});
  }
  for (int i = 0; i < 3000; ++i) {
    const DriverReport report = rig.step(hold_at<TriFinger>(0.3));
    ASSERT_EQ(report.state, State::kReady) << text_of(rig, report);
    EXPECT_LE(report.measurement_age, Nanoseconds(5ms).count());
  }
  expect_true_positions(rig);
}

TEST(BoardRobot, fault_39_CorruptFramesAreDroppedAndCounted) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  rig.buses[1]->add({.kind = can::BusFault::Kind::kCorrupt,
                     .probability = 1e-3,
                     .node = 1,
                     .id = static_cast<std::uint32_t>(encode(can::MotorPositions{}).id)});
  for (int i = 0; i < 5000; ++i) {
    const DriverReport report = rig.step(hold_at<TriFinger>(0.3));
    ASSERT_EQ(report.state, State::kReady) << text_of(rig, report);
  }
  const Board::Counts& counts = rig.robot->boards()[1].counts();
  EXPECT_GT(counts.invalid + counts.implausible, 0U);
  expect_true_positions(rig);
}

// Without the check, motors at rest would soon be too warm.
TEST(BoardRobot, fault_39_CorruptCurrentsDoNotWarmTheMotors) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  rig.buses[1]->add({.kind = can::BusFault::Kind::kCorrupt,
                     .probability = 0.01,
                     .node = 1,
                     .id = static_cast<std::uint32_t>(encode(can::MotorCurrents{}).id)});
  const auto options = options_of_tests<TriFinger>();
  const double most = 2 * options.max_current * options.motors[0].torque_per_ampere();
  for (int i = 0; i < 5000; ++i) {
    const DriverReport report = rig.step(hold_at<TriFinger>(0.3));
    ASSERT_EQ(report.state, State::kReady) << text_of(rig, report);
    for (const double torque : rig.observation.torque) ASSERT_LE(std::abs(torque), most);
  }
  EXPECT_GT(rig.robot->boards()[1].counts().implausible, 0U);
}

TEST(BoardRobot, fault_41_AFloodOfForeignFramesDoesNotStopIt) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  rig.buses[5]->add({.kind = can::BusFault::Kind::kFlood,
                     .begin = rig.clock.now(),
                     .end = rig.clock.now() + 1s,
                     .id = 0x123,
                     .rate = 20'000});
  for (int i = 0; i < 1500; ++i) {
    const DriverReport report = rig.step(hold_at<TriFinger>(0.3));
    ASSERT_EQ(report.state, State::kReady) << text_of(rig, report);
  }
  EXPECT_GT(rig.robot->boards()[5].counts().invalid, 10'000U);
}

TEST(BoardRobot, fault_44_WithoutCurrentTheNextStatusNamesTheError) {
  for (int code = 1; code < 8; ++code) {
    const auto error = static_cast<can::BoardError>(code);
    Rig<OneJoint> rig;
    rig.joints.weight = 0.0;
    ASSERT_TRUE(is_prepared(rig));
    for (int i = 0; i < 100; ++i) ASSERT_EQ(rig.step({}).state, State::kReady);
    rig.emulator->board(0).fail(error);
    std::string text;
    const int ms = time_to_fault(rig, {}, text);
    EXPECT_GE(ms, 1);
    EXPECT_LE(ms, 1001);
    EXPECT_NE(text.find(can::text_of(error).sentence), std::string::npos) << text;
  }
}

TEST(BoardRobot, fault_43_ABoardThatIsSwitchedOffAndOnAfterAnErrorIsHomedAgain) {
  Rig<OneJoint> rig;
  ASSERT_TRUE(is_prepared(rig));
  rig.emulator->board(0).fail(can::BoardError::kEncoder);
  std::string text;
  EXPECT_GE(time_to_fault(rig, hold_at<OneJoint>(0.3), text), 1);
  rig.emulator->set_power(false, rig.clock.now());
  for (int i = 0; i < 100; ++i) rig.pass();
  rig.emulator->set_power(true, rig.clock.now());
  ASSERT_TRUE(is_prepared(rig));
  ASSERT_EQ(rig.step(hold_at<OneJoint>(0.3)).state, State::kReady);
  expect_true_positions(rig);
}

TEST(BoardRobot, fault_42_TheOtherBoardsAreDampedWhenOneIsSilent) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  TriFinger::Action action;
  action.torque.fill(0.3);
  for (int i = 0; i < 50; ++i) ASSERT_EQ(rig.step(action).state, State::kReady);
  rig.emulator->set_power(5, false, rig.clock.now());
  DriverReport report;
  while (report.state != State::kFault) report = rig.step(action);
  const double velocity = rig.joints.velocity()[0];
  ASSERT_GT(velocity, 0.5);
  for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) rig.pass();
  EXPECT_LT(std::abs(rig.joints.velocity()[0]), 0.5 * velocity);
}

TEST(BoardRobot, fault_40_ABusThatTakesNoFramesIsFound) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  const Instant now = rig.clock.now();
  rig.buses[1]->add({.kind = can::BusFault::Kind::kQueueFull, .begin = now, .end = now + 50ms});
  std::string text;
  const int ms = time_to_fault(rig, hold_at<TriFinger>(0.3), text);
  EXPECT_GE(ms, 1);
  EXPECT_LE(ms, 10);
  EXPECT_NE(text.find("board 1"), std::string::npos) << text;
}

TEST(BoardRobot, ARobotThatWasNeverPreparedLeavesTheBoardsAlone) {
  Rig<TriFinger> rig;
  ASSERT_EQ(rig.prepare().state, State::kReady);
  std::vector<std::unique_ptr<can::Bus>> buses;
  buses.reserve(rig.buses.size());
  for (const auto& bus : rig.buses) buses.push_back(bus->connect());
  // As a second 'trifinger run' that finds out that the robot is run already.
  std::optional<BoardRobot> other;
  other.emplace(options_of_tests<TriFinger>(), std::move(buses), rig.clock);
  other.reset();
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(rig.step(hold_at<TriFinger>(0.3)).state, State::kReady) << i;
  }
}

TEST(BoardRobot, ASecondHostOnABusIsAFault) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  const auto other = rig.buses[2]->connect();
  DriverReport report;
  for (int i = 0; i < 100 && report.state != State::kFault; ++i) {
    static_cast<void>(other->send(std::array{encode(can::DesiredCurrents{})}));
    report = rig.step(hold_at<TriFinger>(0.3));
  }
  ASSERT_EQ(report.state, State::kFault);
  EXPECT_NE(text_of(rig, report).find("somebody else sends commands"), std::string::npos);
}

TEST(BoardRobot, fault_40_WhenTheHostIsGoneTheBoardsLetTheirMotorsGo) {
  Rig<TriFinger> rig;
  ASSERT_TRUE(is_prepared(rig));
  TriFinger::Action action;
  action.torque.fill(0.2);
  // The first frames to a board are lost: the time limit must not be among those that never come.
  rig.buses[0]->add({.kind = can::BusFault::Kind::kLose,
                     .begin = rig.clock.now(),
                     .end = rig.clock.now() + 5ms,
                     .node = 0});
  for (int i = 0; i < 300; ++i) ASSERT_EQ(rig.step(action).state, State::kReady);
  for (int i = 0; i < 12; ++i) rig.pass();
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(rig.emulator->board(i).currents(), (can::MotorPair{})) << "board " << i;
  }
}

// ---- bad input ----

TEST(BoardRobotOptions, SayWhatMakesNoSense) {
  auto options = options_of_tests<TriFinger>();
  options.interfaces.pop_back();
  EXPECT_EQ(message_of<InvalidArgument>([&] { options.validate(); }),
            "the motor of joint 6 is on board 5, but there are 5");
  options = options_of_tests<TriFinger>();
  options.interfaces[3] = "can2";
  EXPECT_EQ(message_of<InvalidArgument>([&] { options.validate(); }),
            "boards 2 and 3 are both on can2");
  options = options_of_tests<TriFinger>();
  options.board.receive_timeout = 500us;
  EXPECT_EQ(message_of<InvalidArgument>([&] { options.validate(); }),
            "receive_timeout is 0.5 ms, must be a whole number of ms and longer than the period");
  options = options_of_tests<TriFinger>();
  options.motors[4].place = options.motors[1].place;
  EXPECT_EQ(message_of<InvalidArgument>([&] { options.validate(); }),
            "joints 1 and 4 are on the same motor");
  options = options_of_tests<TriFinger>();
  options.motors[2].polarity = 0.5;
  EXPECT_EQ(message_of<InvalidArgument>([&] { options.validate(); }),
            "the polarity of joint 2 is 0.5, must be 1 or -1");
  options = options_of_tests<TriFinger>();
  options.max_current = std::nan("");
  EXPECT_EQ(message_of<InvalidArgument>([&] { options.validate(); }),
            "max_current is nan A, must be above 0 and at most 20");
}

}  // namespace
}  // namespace trifinger::boards::test
