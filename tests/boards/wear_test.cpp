// SPDX-License-Identifier: BSD-3-Clause
#include "boards/wear.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>
#include <vector>

#include "rig.hpp"
#include "support/allocation_counter.hpp"

namespace trifinger::boards::test {
namespace {

using namespace std::chrono_literals;
using trifinger::test::AllocationCounter;
using State = DriverReport::State;

constexpr double kTorqueConstant = 0.02;  // [Nm/A]

// A motor that is moved by hand.
class Motor {
 public:
  MotorMeter::Step move_to(double revolutions) {
    reading_.revolutions = revolutions;
    return meter_.measure(reading_, 1e-3, kTorqueConstant, 2.0);
  }
  MotorMeter::Step pass_index_at(double revolutions) {
    reading_.index = revolutions;
    ++reading_.index_pulses;
    return move_to(revolutions);
  }
  void set_current(double amperes) { reading_.amperes = amperes; }
  void lose_supply() { meter_.forget(reading_); }

 private:
  MotorReading reading_;
  MotorMeter meter_;
};

TEST(MotorMeter, CountsTheWayForthAndBack) {
  Motor motor;
  motor.set_current(-2.0);
  double revolutions = 0.0;
  double work = 0.0;
  for (int i = 0; i <= 200; ++i) {
    const MotorMeter::Step step = motor.move_to(0.05 * (i <= 100 ? i : 200 - i));
    revolutions += step.revolutions;
    work += step.work;
    EXPECT_DOUBLE_EQ(step.powered_time, 1e-3);
    EXPECT_DOUBLE_EQ(step.squared_current, 4.0 * 1e-3);
  }
  EXPECT_NEAR(revolutions, 10.0, 0.003);
  EXPECT_NEAR(work, 10.0 * 2 * std::numbers::pi * 2.0 * kTorqueConstant, 1e-3);
}

TEST(MotorMeter, CountsNoWayOfAnEncoderThatIsNotQuiteStill) {
  Motor motor;
  static_cast<void>(motor.move_to(7.0));
  std::mt19937 random(1);
  std::uniform_int_distribution<int> counts(-3, 3);
  double revolutions = 0.0;
  for (int i = 0; i < 10'000; ++i) {
    revolutions += motor.move_to(7.0 + counts(random) / 20'000.0).revolutions;
  }
  EXPECT_EQ(revolutions, 0.0);
}

TEST(MotorMeter, CountsNoWayWhenPositionsBeginElsewhere) {
  Motor motor;
  static_cast<void>(motor.move_to(40.0));
  EXPECT_EQ(motor.move_to(0.0).revolutions, 0.0);
  EXPECT_NEAR(motor.move_to(0.5).revolutions, 0.5, 0.002);
  motor.lose_supply();
  EXPECT_EQ(motor.move_to(0.0).revolutions, 0.0);
}

TEST(MotorMeter, CountsASlipOnce) {
  Motor motor;
  EXPECT_FALSE(motor.pass_index_at(0.25).has_slipped);  // the first one
  EXPECT_FALSE(motor.pass_index_at(1.25).has_slipped);
  EXPECT_FALSE(motor.pass_index_at(0.2501).has_slipped);  // a count of the encoder
  EXPECT_TRUE(motor.pass_index_at(1.26).has_slipped);
  EXPECT_FALSE(motor.move_to(1.5).has_slipped);
  EXPECT_FALSE(motor.pass_index_at(0.26).has_slipped);
  EXPECT_TRUE(motor.pass_index_at(0.75).has_slipped);
}

TEST(MotorMeter, FindsNoSlipBetweenPositionsOfDifferentKinds) {
  Motor motor;
  static_cast<void>(motor.pass_index_at(0.25));
  motor.lose_supply();
  EXPECT_FALSE(motor.move_to(0.1).has_slipped);
  EXPECT_FALSE(motor.pass_index_at(0.6).has_slipped);
  EXPECT_FALSE(motor.pass_index_at(30.9).has_slipped);  // a jump: they count from elsewhere
  EXPECT_FALSE(motor.pass_index_at(29.9).has_slipped);
}

// ---- a whole robot ----

TriFinger::Action to_start() {
  JointVector<9> start{};
  start.fill(0.3);
  return TriFinger::Action::of_position(start);
}

// Moves all joints to and fro for `steps`; returns what the observations say, plain sums.
Wear drive(Rig<TriFinger>& rig, int steps) {
  Wear sum(9);
  const BoardRobotOptions& options = rig.robot->options();
  const double gear = options.motors[0].gear_ratio;
  const double ampere = options.motors[0].torque_per_ampere();
  EXPECT_EQ(rig.step(to_start()).state, State::kReady);
  auto before = rig.observation;
  for (int step = 0; step < steps; ++step) {
    JointVector<9> position{};
    for (std::size_t i = 0; i < 9; ++i) {
      const double amplitude = 0.3 + 0.05 * static_cast<double>(i);
      position[i] = 0.3 + amplitude * std::sin(2.0 * std::numbers::pi * step / 1500.0);
    }
    EXPECT_EQ(rig.step(TriFinger::Action::of_position(position)).state, State::kReady);
    for (std::size_t i = 0; i < 9; ++i) {
      const double way = std::abs(rig.observation.position[i] - before.position[i]);
      const double torque = rig.observation.torque[i];
      sum.powered_time[i] += 1e-3;
      sum.revolutions[i] += way * gear / (2.0 * std::numbers::pi);
      sum.work[i] += std::abs(torque) * way;
      sum.squared_current[i] += 1e-3 * torque * torque / (ampere * ampere);
    }
    before = rig.observation;
  }
  return sum;
}

void expect_sum(const Wear& before, const Wear& added, const Wear& after) {
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(after.powered_time[i], before.powered_time[i] + added.powered_time[i], 1.5e-3);
    EXPECT_NEAR(after.revolutions[i], before.revolutions[i] + added.revolutions[i],
                0.01 * added.revolutions[i]);
    EXPECT_NEAR(after.work[i], before.work[i] + added.work[i], 0.02 * added.work[i] + 1e-4);
    EXPECT_NEAR(after.squared_current[i], before.squared_current[i] + added.squared_current[i],
                0.01 * added.squared_current[i]);
    EXPECT_EQ(after.index_slips[i], before.index_slips[i]);
  }
}

// Files of running hours and logs have these elements.
TEST(Wear, HasTheBytesOfAStructWithArrays) {
  EXPECT_EQ(Wear::describe(9), describe<WearElement<9>>());
  EXPECT_EQ(Wear::describe(1), describe<WearElement<1>>());
  Wear wear(2);
  wear.starts = 1;
  wear.homings = 2;
  wear.faults = 3;
  wear.powered_time = {4.0, 5.0};
  wear.revolutions = {6.0, 7.0};
  wear.work = {8.0, 9.0};
  wear.squared_current = {10.0, 11.0};
  wear.index_slips = {12, 13};
  WearElement<2> element;
  wear.write({.arrival_index = 14}, &element);
  EXPECT_EQ(element.stamp.arrival_index, 14);
  EXPECT_EQ(element.faults, 3U);
  EXPECT_EQ(element.powered_time, (JointVector<2>{4.0, 5.0}));
  EXPECT_EQ(element.revolutions, (JointVector<2>{6.0, 7.0}));
  EXPECT_EQ(element.work, (JointVector<2>{8.0, 9.0}));
  EXPECT_EQ(element.squared_current, (JointVector<2>{10.0, 11.0}));
  EXPECT_EQ(element.index_slips, (std::array<std::uint64_t, 2>{12, 13}));
  Wear again(2);
  again.read(&element);
  EXPECT_EQ(again.homings, 2U);
  EXPECT_EQ(again.revolutions, wear.revolutions);
  EXPECT_EQ(again.work, wear.work);
  EXPECT_EQ(again.index_slips, wear.index_slips);
}

TEST(Wear, IsWhatTheObservationsSay) {
  Rig<TriFinger> rig;
  ASSERT_EQ(rig.prepare().state, State::kReady);
  const Wear before = rig.robot->wear();
  EXPECT_EQ(before.homings, 1U);
  for (const double revolutions : before.revolutions) EXPECT_GT(revolutions, 1.0);  // of homing
  const Wear added = drive(rig, 3000);
  for (const double revolutions : added.revolutions) ASSERT_GT(revolutions, 2.0);
  expect_sum(before, added, rig.robot->wear());
}

TEST(Wear, IsTheSumOfAllStarts) {
  std::vector<std::byte> kept;
  Wear sum(9);
  for (std::uint64_t start = 1; start <= 3; ++start) {
    Rig<TriFinger> rig;
    rig.robot->continue_wear(kept);
    EXPECT_EQ(rig.robot->wear().starts, start);
    ASSERT_EQ(rig.prepare().state, State::kReady);
    EXPECT_EQ(rig.robot->wear().homings, start);
    if (start == 1) sum = rig.robot->wear();
    const Wear before = rig.robot->wear();
    for (std::size_t i = 0; i < 9; ++i) EXPECT_GE(before.revolutions[i], sum.revolutions[i]);
    const Wear added = drive(rig, 500);
    expect_sum(before, added, rig.robot->wear());
    sum = rig.robot->wear();
    kept = rig.robot->wear_bytes();
  }
}

TEST(Wear, OfAnotherRobotIsRefused) {
  Rig<OneJoint> rig;
  EXPECT_THROW(rig.robot->continue_wear(std::vector<std::byte>(sizeof(WearElement<9>))),
               InvalidArgument);
}

TEST(Wear, DoesNotGrowInAPause) {
  Rig<OneJoint> rig;
  ASSERT_EQ(rig.prepare().state, State::kReady);
  ASSERT_EQ(rig.step({}).state, State::kReady);
  for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) rig.pass();
  const Wear before = rig.robot->wear();
  // Somebody turns the joint by hand, by half a revolution of the motor.
  const double angle = rig.joints.position()[0];
  rig.joints.weight = 0.0;
  rig.joints.push[0] = 0.1;
  while (std::abs(rig.joints.position()[0] - angle) < 0.35) rig.pass();
  rig.joints.is_blocked = true;
  for (int i = 0; i < 2000; ++i) rig.pass();
  static_cast<void>(rig.robot->prepare(0));
  for (TimeIndex i = 1; i < 5; ++i) {
    rig.pass();
    static_cast<void>(rig.robot->prepare(i));
  }
  const Wear& after = rig.robot->wear();
  EXPECT_LT(after.powered_time[0] - before.powered_time[0], 0.01);
  EXPECT_LT(after.revolutions[0] - before.revolutions[0], 0.05);
}

TEST(Wear, CountsAFaultOnceAndNoWayOfABoardThatWasOff) {
  Rig<TriFinger> rig;
  ASSERT_EQ(rig.prepare().state, State::kReady);
  const TriFinger::Action hold = to_start();
  for (std::uint64_t fault = 1; fault <= 3; ++fault) {
    const Wear before = rig.robot->wear();
    rig.emulator->set_power(2, false, rig.clock.now());
    DriverReport report;
    while (report.state != State::kFault) report = rig.step(hold);
    for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) rig.pass();
    EXPECT_EQ(rig.robot->wear().faults, fault);
    // The joints of this board, 4 and 5, fell for a moment only.
    EXPECT_LT(rig.robot->wear().revolutions[4] - before.revolutions[4], 0.2);
    for (int i = 0; i < 200; ++i) rig.pass();
    rig.emulator->set_power(true, rig.clock.now());
    report = rig.prepare();
    ASSERT_EQ(report.state, State::kReady) << rig.robot->fault_text(report.fault_code);
    EXPECT_EQ(rig.robot->wear().homings, fault + 1);
    // To the end stop and back; less than the whole range twice.
    const double range = 2.0 * 4.3 * 9.0 / (2.0 * std::numbers::pi);
    EXPECT_LT(rig.robot->wear().revolutions[4] - before.revolutions[4], range);
  }
}

TEST(Wear, HasAnElementForEachSecondAndTakesNoMemory) {
  Rig<TriFinger> rig;
  ASSERT_EQ(rig.robot->companions().size(), 1U);
  ASSERT_EQ(rig.robot->companions()[0].element.size(), sizeof(WearElement<9>));
  ASSERT_EQ(rig.prepare().state, State::kReady);
  WearElement<9> element;
  EXPECT_TRUE(rig.robot->get_companion_element(0, -1, &element));
  EXPECT_FALSE(rig.robot->get_companion_element(0, -1, &element));
  WearElement<9> before = element;
  const TriFinger::Action hold = to_start();
  const AllocationCounter allocations;
  std::size_t elements = 0;
  for (TimeIndex t = 0; t < 3500; ++t) {
    ASSERT_EQ(rig.step(hold).state, State::kReady);
    while (rig.robot->get_companion_element(0, t, &element)) {
      ++elements;
      EXPECT_EQ(element.stamp.arrival_index, t);
      for (std::size_t i = 0; i < 9; ++i) {
        EXPECT_GT(element.powered_time[i], before.powered_time[i]);
        EXPECT_GE(element.revolutions[i], before.revolutions[i]);
        EXPECT_GE(element.work[i], before.work[i]);
        EXPECT_GT(element.squared_current[i], before.squared_current[i]);
      }
      before = element;
    }
  }
  EXPECT_EQ(elements, 3U);
  EXPECT_EQ(allocations.count(), 0U);
}

}  // namespace
}  // namespace trifinger::boards::test
