// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/motor_runner.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "dynamixel/rig.hpp"

namespace trifinger::dynamixel::detail {
namespace {

using namespace std::chrono_literals;
using Phase = MotorSnapshot::Phase;
using test::kBegin;

// Three motors that have been started, in simulated time, and when which phase was told first.
class Runner : public ::testing::Test {
 protected:
  Runner() {
    runner_ = std::make_unique<MotorRunner>(
        std::make_unique<MotorGroup>(std::move(made_), MotorGroupOptions{.ids = {1, 2, 3}}),
        Nanoseconds(0), 50ms, [this](const MotorSnapshot& snapshot) {
          if (snapshot.phase == Phase::kFailed && !failed_) failed_ = port_->now();
        });
    runner_->obey(request_of(1, true));
    EXPECT_TRUE(runner_->is_running());
  }

  InertiaPlant plant_{3};
  EmulatedBus line_{test::motors_of({1, 2, 3}, 4'000'000, 0us), plant_, kBegin};
  std::unique_ptr<EmulatedPort> made_{std::make_unique<EmulatedPort>(line_, 4'000'000, kBegin)};
  EmulatedPort* port_{made_.get()};  // the group owns it
  std::optional<Instant> failed_{};
  std::unique_ptr<MotorRunner> runner_;
};

// A robot's loop would otherwise see measurements that are too old, and not learn why.
TEST_F(Runner, TellsWhyItHasFailedBeforeMotorsConfirmThatTheyAreOff) {
  line_.motor(2).set_power(false);
  while (runner_->is_running()) runner_->cycle(nullptr);
  ASSERT_TRUE(failed_);
  EXPECT_GE(port_->now() - *failed_, 250ms);
  EXPECT_FALSE(runner_->snapshot().readings[0].has_torque);
  EXPECT_TRUE(runner_->snapshot().readings[2].has_torque);
}

TEST_F(Runner, SaysWhichMotorDoesNotConfirmARelease) {
  runner_->obey(request_of(2, false));
  EXPECT_EQ(runner_->snapshot().phase, Phase::kReleased);
  EXPECT_EQ(runner_->snapshot().request, 2U);
  runner_->obey(request_of(3, true));
  line_.motor(1).set_power(false);
  runner_->obey(request_of(4, false));
  EXPECT_EQ(runner_->snapshot().phase, Phase::kFailed);
  EXPECT_EQ(runner_->snapshot().request, 4U);
  EXPECT_EQ(runner_->snapshot().failure.view(),
            "motor 2 does not confirm that its torque is off; switch its supply off");
}

}  // namespace
}  // namespace trifinger::dynamixel::detail
