// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <latch>
#include <optional>
#include <random>
#include <thread>
#include <vector>

#include "core/fault_of.hpp"
#include "core/intruder.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "sim/drivers_of_tests.hpp"
#include "support/soak.hpp"

// The user's file is hostile: while a simulated robot runs, another thread writes random bytes and
// random actions into it.

namespace trifinger::test {
namespace {

using Traits = SimulatedRobotTraits<TriFinger>;
using Robot = Frontend<TriFinger>;

// A step that no session reaches.
constexpr TimeIndex kNever = 1'000'000'000;

// Returns an action in which every number has random bits.
TriFinger::Action random_bits(std::mt19937& random) {
  TriFinger::Action action;
  for (auto* const values :
       {&action.torque, &action.position, &action.position_kp, &action.position_kd}) {
    for (double& value : *values) {
      value = std::bit_cast<double>((std::uint64_t{random()} << 32U) | random());
    }
  }
  return action;
}

// The attack is limited by counts, so that slow machines do the same. It begins with the steps.
struct Attack {
  static constexpr int kSteps = 30;
  static constexpr int kScribbles = 300;

  Attack(unsigned seed, std::latch& its_begin)
      : random(seed), bytes(1 << (seed % 6)), begin(&its_begin) {}

  void operator()() {
    const Intruder<TriFinger::Action> intruder;
    begin->arrive_and_wait();
    for (int i = 0; i < kScribbles; ++i) {
      intruder.scribble(random, bytes);
      intruder.put(static_cast<TimeIndex>(random() % (2 * kSteps)), random_bits(random));
    }
  }

  std::mt19937 random;
  int bytes;
  std::latch* begin;
};

// Reads every step, as the back-end has written it.
void expect_no_limit_broken(const Robot& observer, const std::vector<JointLimit>& limits) {
  constexpr TimeIndex kKept = 4000;
  const TimeIndex steps = observer.session().info().steps;
  for (TimeIndex t = std::max<TimeIndex>(0, steps - kKept); t < steps; ++t) {
    const auto applied = observer.get_applied_action(t);
    const auto observation = observer.get_observation(t);
    for (std::size_t i = 0; i < 9; ++i) {
      // Written so that NaN fails.
      ASSERT_TRUE(std::abs(applied.torque[i]) <= limits[i].max_torque) << t << " joint " << i;
      ASSERT_TRUE(observation.position[i] >= limits[i].hard_lower &&
                  observation.position[i] <= limits[i].hard_upper)
          << t << " joint " << i;
    }
  }
}

TEST(HostileQueueOfASimulation, fault_29_RandomBytesBreakNoLimitAndTheNextSessionWorks) {
  const auto limits = default_limits(options_of_tests<TriFinger>().description);
  AcrossProcesses::Rig<Traits> rig({.session = {.history = 4096, .queue = 64}});
  int stopped = 0;
  Rounds rounds(100, std::chrono::minutes(10));
  while (rounds.next()) {
    const auto round = static_cast<unsigned>(rounds.index());
    SCOPED_TRACE(round);
    std::optional<Robot> robot(rig.connect({}));
    const Robot observer = rig.observe();
    const auto fault = [&]() -> std::optional<Fault> {
      const Intruder<TriFinger::Action> intruder;
      std::latch begin(2);
      std::jthread attacker{Attack(round, begin)};
      begin.arrive_and_wait();
      try {
        for (int i = 0; i < Attack::kSteps; ++i) {
          const TimeIndex t = robot->append_desired_action(Traits::action(i), kLong);
          if (!observes(*robot, intruder, t)) break;
        }
      } catch (const RobotStopped& end) {
        return end.fault();
      } catch (const HistoryLost&) {
        // The random bytes have made more actions than this test has appended.
      }
      return std::nullopt;
    }();
    stopped += fault ? 1 : 0;
    if (fault) {
      // The fault must be the user's, never that of the robot or its program.
      EXPECT_NE(fault->code, Fault::Code::kDriver);
      EXPECT_NE(fault->code, Fault::Code::kBackendDied);
    }
    expect_no_limit_broken(observer, limits);
    if (HasFatalFailure()) return;
    robot.reset();
    // Actions under way may still end the session by a fault. It can be cleared only after that.
    ASSERT_TRUE(fault_of([&] { return observer.get_status(kNever, kLong); }));
    recover("robot", kLong);
  }
  EXPECT_GT(stopped, 0) << "the bytes did no harm; is the intruder at the right place?";
  std::printf("%lld sessions with random bytes, %d of them ended by a fault, no limit broken\n",
              static_cast<long long>(rounds.index()), stopped);

  Robot robot = rig.connect();
  run_steps<Traits>(robot, 0, 9);
  robot.finish();
  expect_end(robot, 10, {.code = Fault::Code::kFinished});
}

}  // namespace
}  // namespace trifinger::test
