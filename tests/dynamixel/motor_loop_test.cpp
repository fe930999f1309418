// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/motor_loop.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "dynamixel/emulator.hpp"
#include "dynamixel/rig.hpp"
#include "support/allocation_counter.hpp"
#include "support/folder.hpp"

namespace trifinger::dynamixel::test {
namespace {

using namespace std::chrono_literals;
using Phase = MotorSnapshot::Phase;

// Three motors at a pseudo-terminal and the loop that drives them. A busy machine may stop any
// thread for long, so nothing here has a short time limit.
class Loops : public ::testing::Test {
 protected:
  void begin(OperatingMode mode, Nanoseconds goal_timeout = 100s, const std::string& path = {}) {
    auto port = std::make_unique<SerialPort>(path.empty() ? emulator_->path() : path,
                                             SerialOptions{.baud = 4'000'000});
    auto group = std::make_unique<MotorGroup>(
        std::move(port),
        MotorGroupOptions{.ids = {1, 2, 3}, .mode = mode, .watchdog = 0ms, .silent_after = 60s},
        5s);
    loop_ = std::make_unique<MotorLoop>(
        std::move(group),
        MotorLoopOptions{.goal_timeout = goal_timeout, .realtime = {.demand = Demand::kOff}});
  }
  // Reads until `is_true`. The watchdog of the tests ends a wait for ever.
  void wait(const std::function<bool(const MotorSnapshot&)>& is_true) {
    while (!is_true(snapshot_)) {
      loop_->read(snapshot_);
      std::this_thread::yield();
    }
  }
  void start() {
    const std::uint64_t request = loop_->request_start();
    wait([&](const MotorSnapshot& snapshot) {
      return snapshot.request >= request && snapshot.phase != Phase::kStarting;
    });
  }
  [[nodiscard]] std::int32_t value(std::size_t motor, const Register& which) {
    std::int32_t value = 0;
    emulator_->change([&](EmulatedBus& line) { value = line.motor(motor).value(which); });
    return value;
  }

  InertiaPlant plant_{3};
  std::unique_ptr<Emulator> emulator_{
      std::make_unique<Emulator>(motors_of({1, 2, 3}, 4'000'000, 0us), plant_)};
  std::unique_ptr<MotorLoop> loop_;
  MotorSnapshot snapshot_{};
};

TEST_F(Loops, HoldNothingUntilTheyAreStarted) {
  begin(OperatingMode::kPosition);
  wait([](const MotorSnapshot& snapshot) { return snapshot.count == 3; });
  EXPECT_EQ(snapshot_.phase, Phase::kReleased);
  EXPECT_EQ(value(0, registers::kTorqueEnable), 0);
}

TEST_F(Loops, MoveMotorsToTheNewestGoals) {
  begin(OperatingMode::kPosition);
  start();
  ASSERT_EQ(snapshot_.phase, Phase::kRunning) << snapshot_.failure.view();
  loop_->set_goals(std::array{0.3, -0.3, 0.6});
  wait([](const MotorSnapshot& snapshot) {
    return std::abs(snapshot.readings[0].position - 0.3) < 0.05 &&
           std::abs(snapshot.readings[1].position + 0.3) < 0.05 &&
           std::abs(snapshot.readings[2].position - 0.6) < 0.05;
  });
  EXPECT_GT(snapshot_.cycles, 0U);
}

TEST_F(Loops, LetCurrentsEndWhenNoGoalsCome) {
  begin(OperatingMode::kCurrent, 20ms);
  start();
  wait([&](const MotorSnapshot& snapshot) {
    loop_->set_goals(std::array{0.2, 0.2, 0.2});
    return snapshot.readings[0].current > 0.1;
  });
  wait([](const MotorSnapshot& snapshot) { return snapshot.readings[0].current == 0.0; });
  EXPECT_EQ(snapshot_.phase, Phase::kRunning);
}

TEST_F(Loops, SayWhyTheyHaveFailedAndStartAgain) {
  begin(OperatingMode::kPosition);
  start();
  emulator_->change([](EmulatedBus& line) { line.motor(1).fail(HardwareError::kOverload); });
  wait([](const MotorSnapshot& snapshot) { return snapshot.phase == Phase::kFailed; });
  EXPECT_EQ(snapshot_.fault.kind, MotorFault::kHardwareError);
  EXPECT_EQ(snapshot_.fault.motor, 2);
  EXPECT_NE(snapshot_.failure.view().find("motor 2"), std::string_view::npos);
  start();
  EXPECT_EQ(snapshot_.phase, Phase::kRunning) << snapshot_.failure.view();
}

TEST_F(Loops, AreCutByAnotherThreadAndStartAgain) {
  begin(OperatingMode::kPosition);
  start();
  std::thread([this] { loop_->cut(); }).join();
  wait([](const MotorSnapshot& snapshot) { return snapshot.phase == Phase::kFailed; });
  EXPECT_NE(snapshot_.failure.view().find("because the loop hung"), std::string_view::npos);
  // Nobody answers to a release, so it may still be on its way.
  while (value(0, registers::kTorqueEnable) != 0) std::this_thread::yield();
  start();
  EXPECT_EQ(snapshot_.phase, Phase::kRunning) << snapshot_.failure.view();
}

TEST_F(Loops, FailToStartWithASentence) {
  emulator_->change(
      [](EmulatedBus& line) { line.motor(2).set_value(registers::kModelNumber, 12); });
  begin(OperatingMode::kPosition);
  start();
  EXPECT_EQ(snapshot_.phase, Phase::kFailed);
  EXPECT_NE(snapshot_.failure.view().find("model 12"), std::string_view::npos);
}

TEST_F(Loops, NoticeThatTheTerminalHasGoneAndOpenItAgain) {
  const trifinger::test::Folder folder;
  const std::string link = folder.path() / "claw";
  const auto plug_in = [&] {
    emulator_.reset();  // One emulator at a time moves the plant.
    emulator_ = std::make_unique<Emulator>(motors_of({1, 2, 3}, 4'000'000, 0us), plant_,
                                           EmulatedBusOptions{}, link);
  };
  plug_in();
  begin(OperatingMode::kPosition, 100s, link);
  start();
  emulator_.reset();
  wait([](const MotorSnapshot& snapshot) { return snapshot.phase == Phase::kFailed; });
  EXPECT_EQ(snapshot_.fault.kind, MotorFault::kLineGone);
  start();
  EXPECT_EQ(snapshot_.phase, Phase::kFailed);
  plug_in();
  start();
  EXPECT_EQ(snapshot_.phase, Phase::kRunning) << snapshot_.failure.view();
  // Also if it goes while nobody uses it.
  const std::uint64_t request = loop_->request_release();
  wait([&](const MotorSnapshot& snapshot) { return snapshot.request >= request; });
  plug_in();
  start();
  EXPECT_EQ(snapshot_.phase, Phase::kRunning) << snapshot_.failure.view();
}

TEST_F(Loops, ReleaseMotorsOnRequestAndAtTheirEnd) {
  begin(OperatingMode::kPosition);
  start();
  EXPECT_EQ(value(0, registers::kTorqueEnable), 1);
  const std::uint64_t request = loop_->request_release();
  wait([&](const MotorSnapshot& snapshot) { return snapshot.request >= request; });
  while (value(0, registers::kTorqueEnable) != 0) std::this_thread::yield();
  start();
  EXPECT_EQ(value(2, registers::kTorqueEnable), 1);
  loop_.reset();
  while (value(2, registers::kTorqueEnable) != 0) std::this_thread::yield();
}

TEST_F(Loops, NeverTearASnapshot) {
  begin(OperatingMode::kPosition);
  start();
  std::uint64_t before = snapshot_.cycles;
  for (int i = 0; i < 200;) {
    if (!loop_->read(snapshot_)) continue;
    ++i;
    EXPECT_GT(snapshot_.cycles, before);
    before = snapshot_.cycles;
    // All motors of a cycle were asked by one instruction, unless an answer was lost.
    if (snapshot_.counts.missing == 0) {
      EXPECT_EQ(snapshot_.readings[0].measured, snapshot_.readings[2].measured);
    }
  }
}

TEST_F(Loops, DoNotAllocateForTheirCaller) {
  begin(OperatingMode::kPosition);
  start();
  const std::array goals{0.0, 0.0, 0.0};
  const trifinger::test::AllocationCounter allocations;
  for (int i = 0; i < 1000; ++i) {
    loop_->set_goals(goals);
    loop_->read(snapshot_);
  }
  EXPECT_EQ(allocations.count(), 0U);
}

}  // namespace
}  // namespace trifinger::dynamixel::test
