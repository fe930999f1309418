// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "core/fake_robot.hpp"
#include "core/session_layout.hpp"
#include "core/session_place.hpp"
#include "core/session_writer.hpp"
#include "core/transports.hpp"
#include "ipc/futex.hpp"
#include "ipc/shared_memory.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/frontend.hpp"

// Waits do not depend on wake-ups. A wake-up that is lost, or comes without a cause, only changes
// the time of the result.

namespace trifinger::test {
namespace {

// A session whose back-end is the test itself, with a controller.
class LostWake : public ::testing::Test {
 protected:
  LostWake()
      : host_(SessionHost::named("robot")),
        writers_(host_.place().begin(driver_, false, kPeriod)),
        robot_((writers_.robot->set_phase(detail::Phase::kHolding), host_)) {}

  // Returns when a thread of the controller is about to sleep.
  void wait_for_sleeper() const {
    const detail::ActionHeader& header = writers_.robot->action_header();
    const Deadline deadline(kLong);
    const auto sleeps = [&] {
      return std::ranges::any_of(header.wait_slots, [](const auto& slot) {
        return slot.load(std::memory_order_acquire) != 0;
      });
    };
    while (!sleeps()) {
      ASSERT_FALSE(deadline.passed()) << "nobody waits";
      std::this_thread::yield();
    }
  }
  // Writes like the back-end, but wakes nobody.
  void write_silently(const FakeObservation& observation) const {
    writers_.robot->append(Series::kObservation, &observation);
  }

  SessionFolder folder_;
  FakeDriver driver_;
  SessionHost host_;
  detail::SessionPlace::Writers writers_;
  Frontend<FakeRobot> robot_;
};

TEST_F(LostWake, fault_36_CostsNoStep) {
  for (TimeIndex t = 0; t < 5; ++t) {
    std::thread reader([&] { EXPECT_EQ(robot_.get_observation(t, kLong).applied_actions, t); });
    wait_for_sleeper();
    write_silently({.applied_actions = t});
    reader.join();
  }
}

TEST_F(LostWake, fault_36_WakesWithoutCauseShowNothingThatIsNotThere) {
  std::atomic<bool> is_over{false};
  std::thread disturber([&] {
    auto& event = writers_.robot->header().event;
    while (!is_over.load(std::memory_order_relaxed)) {
      event.fetch_add(1, std::memory_order_seq_cst);
      ipc::futex_wake_all(event);
    }
  });
  EXPECT_THROW(static_cast<void>(robot_.get_observation(0, std::chrono::milliseconds(20))),
               TimedOut);
  std::thread reader([&] { EXPECT_EQ(robot_.get_observation(0, kLong).applied_actions, 42); });
  wait_for_sleeper();
  write_silently({.applied_actions = 42});
  reader.join();
  is_over.store(true, std::memory_order_relaxed);
  disturber.join();
}

// The word in which a sleeper says what it waits for.
TEST(Wanted, fault_71_HasRoomForAnyStep) {
  for (const TimeIndex t : {TimeIndex{0}, TimeIndex{1} << 31U, TimeIndex{1} << 32U,
                            TimeIndex{1} << 53U, TimeIndex{1} << 60U}) {
    for (TimeIndex near = t - 1; near <= t + 1; ++near) {
      for (const auto kind :
           {detail::Wanted::kObservation, detail::Wanted::kStep, detail::Wanted::kQueueSpace}) {
        const auto wanted = detail::Wanted::from(detail::Wanted{kind, near}.word());
        EXPECT_EQ(wanted.kind, kind);
        EXPECT_EQ(wanted.time_index, near);
      }
    }
  }
}

}  // namespace
}  // namespace trifinger::test
