// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/stepped_motors.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <memory>
#include <string_view>
#include <utility>

#include "dynamixel/rig.hpp"

namespace trifinger::dynamixel::test {
namespace {

using namespace std::chrono_literals;
using Phase = MotorSnapshot::Phase;

// Three motors and a link to them, in simulated time.
class Steps : public ::testing::Test {
 protected:
  explicit Steps(SteppedMotorsOptions options = {}) {
    auto port = std::make_unique<EmulatedPort>(line_, 4'000'000, kBegin);
    motors_ = std::make_unique<SteppedMotors>(
        std::make_unique<MotorGroup>(
            std::move(port), MotorGroupOptions{.ids = {1, 2, 3}, .mode = OperatingMode::kPosition}),
        options);
  }
  void step(int count) {
    for (int i = 0; i < count; ++i) static_cast<void>(motors_->read(snapshot_));
  }

  InertiaPlant plant_{3};
  EmulatedBus line_{motors_of({1, 2, 3}, 4'000'000, 0us), plant_, kBegin};
  std::unique_ptr<SteppedMotors> motors_;
  MotorSnapshot snapshot_{};
};

TEST_F(Steps, LetTimePassInEachRead) {
  step(10);
  EXPECT_EQ(motors_->now() - kBegin, 10ms);
  EXPECT_EQ(snapshot_.phase, Phase::kReleased);
  EXPECT_EQ(snapshot_.cycles, 0U);
}

TEST_F(Steps, RunAsManyCyclesAsFitIntoAStep) {
  EXPECT_EQ(motors_->request_start(), 1U);
  step(1);
  ASSERT_EQ(snapshot_.phase, Phase::kRunning) << snapshot_.failure.view();
  EXPECT_EQ(snapshot_.request, 1U);
  const Instant begin = motors_->now();
  const std::uint64_t cycles = snapshot_.cycles;
  step(1000);
  // The cycle that has begun in a step ends in the next one.
  EXPECT_NEAR(std::chrono::duration<double>(motors_->now() - begin).count(), 1.0, 1e-3);
  EXPECT_GT(snapshot_.cycles - cycles, 1000U);
}

TEST_F(Steps, SendTheNewestGoalsAndLetGo) {
  static_cast<void>(motors_->request_start());
  for (int i = 0; i < 2000; ++i) {
    motors_->set_goals(std::array{0.3, -0.3, 0.6});
    step(1);
  }
  EXPECT_NEAR(snapshot_.readings[0].position, 0.3, 0.05);
  EXPECT_NEAR(snapshot_.readings[2].position, 0.6, 0.05);
  EXPECT_EQ(motors_->request_release(), 2U);
  step(1);
  EXPECT_EQ(snapshot_.phase, Phase::kReleased);
  EXPECT_EQ(line_.motor(0).value(registers::kTorqueEnable), 0);
}

TEST_F(Steps, TellWhetherSomethingIsNew) {
  EXPECT_TRUE(motors_->read(snapshot_));
  EXPECT_FALSE(motors_->read(snapshot_));
  static_cast<void>(motors_->request_start());
  EXPECT_TRUE(motors_->read(snapshot_));
}

TEST_F(Steps, AreCut) {
  static_cast<void>(motors_->request_start());
  step(10);
  motors_->cut();
  step(1);
  EXPECT_EQ(snapshot_.phase, Phase::kFailed);
  EXPECT_NE(snapshot_.failure.view().find("because the loop hung"), std::string_view::npos);
  EXPECT_EQ(line_.motor(2).value(registers::kTorqueEnable), 0);
}

}  // namespace
}  // namespace trifinger::dynamixel::test
