// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <random>
#include <thread>
#include <type_traits>
#include <vector>

#include "core/drivers_of_tests.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/interruptions.hpp"

// A program that reads by index gives bit for bit equal series, whatever the delays of any process.
// The program here is a feedback loop: each action depends on the observation and on the
// companion's newest element at that step. So a single element that comes too early or too late
// changes everything after it.

namespace trifinger::test {
namespace {

constexpr TimeIndex kRunSteps = 300;

// A driver on a transport.
template <class DriverTraits, class TransportType>
struct Case {
  using Traits = DriverTraits;
  using Robot = typename Traits::Robot;
  using Rig = typename TransportType::template Rig<Traits>;
};

void append(Bytes& bytes, const Bytes& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

std::uint64_t hash_of(const Bytes& bytes) {
  std::uint64_t hash = 1;
  for (const std::byte byte : bytes)
    hash = hash * 6364136223846793005ULL + static_cast<unsigned>(byte) + 1;
  return hash;
}

// What the companion knew at step t, without clock times, counted from step 0.
template <class R>
class CompanionBytes {
 public:
  CompanionBytes(const Frontend<R>& robot, const CompanionDescription& description,
                 TimeIndex first_index = 0)
      : companion_(robot.companion(description.name)),
        element_(description.element.size()),
        first_index_(first_index) {}

  [[nodiscard]] Bytes at(TimeIndex t) {
    if (!companion_.get_latest_at(t, element_.data(), kForever)) return {};
    Stamp stamp;
    std::memcpy(&stamp, element_.data(), sizeof(stamp));
    stamp.arrival_time = stamp.capture_time = 0;
    stamp.arrival_index -= first_index_;
    stamp.capture_index -= first_index_;
    std::memcpy(element_.data(), &stamp, sizeof(stamp));
    return element_;
  }

 private:
  UntypedFrontend companion_;
  Bytes element_;
  TimeIndex first_index_;
};

// All series, without clock times.
template <class R>
Bytes series_of(const Frontend<R>& robot, CompanionBytes<R>& companion, TimeIndex first_index = 0) {
  Bytes bytes;
  for (TimeIndex t = first_index; t < first_index + kRunSteps; ++t) {
    append(bytes, bytes_of(robot.get_observation(t)));
    append(bytes, bytes_of(robot.get_desired_action(t)));
    append(bytes, bytes_of(robot.get_applied_action(t)));
    Status status = robot.get_status(t);
    status.time = status.lateness = 0;
    append(bytes, bytes_of(status));
    append(bytes, companion.at(t));
  }
  return bytes;
}

// The process of the back-end, if it is another one.
std::vector<pid_t> other_process_of(const auto& rig) {
  if constexpr (requires { rig.process(); }) return {rig.process().pid()};
  return {};
}

void sleep_sometimes(std::minstd_rand& random, bool may_sleep) {
  if (!may_sleep || random() % 4 != 0) return;
  std::this_thread::sleep_for(std::chrono::microseconds(random() % 300));
}

struct Circumstances {
  std::uint32_t delay_seed{0};
  bool has_deadlines{false};
  bool has_interruptions{false};
  TimeIndex first_index{0};
};

template <class Case>
Bytes run_program(const Circumstances& circumstances = {}) {
  using Traits = typename Case::Traits;
  const auto [delay_seed, has_deadlines, has_interruptions, first] = circumstances;
  const auto driver = Traits::make_driver();
  const CompanionDescription& description = driver->companions()[0];
  Plan plan = has_deadlines ? with_deadlines() : Plan{};
  plan.session = {.history = 512, .queue = 64};
  plan.injection = {.delay_seed = delay_seed};
  plan.first_index = first;
  Interruptions interruptions;
  typename Case::Rig rig(plan);
  if (has_interruptions) interruptions.begin(other_process_of(rig));
  auto robot = rig.connect();
  if (has_deadlines) rig.tick();  // the first period is over before the first action
  CompanionBytes<typename Case::Robot> companion(robot, description, first);
  std::minstd_rand random(delay_seed);
  std::uint64_t knowledge = 0;
  for (TimeIndex t = first; t < first + kRunSteps; ++t) {
    if (t > first) {
      // Either order is fine, because reading does not remove anything.
      if (random() % 2 == 0) static_cast<void>(companion.at(t - 1));
      Bytes known = bytes_of(robot.get_observation(t - 1));
      append(known, companion.at(t - 1));
      knowledge = hash_of(known);
    }
    sleep_sometimes(random, delay_seed != 0);
    EXPECT_EQ(robot.append_desired_action(Traits::action(static_cast<TimeIndex>(knowledge % 50))),
              t);
    if (has_deadlines) rig.tick();
  }
  if (!has_deadlines) robot.finish();
  return series_of(robot, companion, first);
}

template <class Traits>
class Determinism : public ::testing::Test {};
using Drivers = ::testing::Types<FakeDriverTraits, OddDriverTraits>;
TYPED_TEST_SUITE(Determinism, Drivers);

TYPED_TEST(Determinism, HoldsWhateverTheDelaysOfAnyThread) {
  const Bytes expected = run_program<Case<TypeParam, Inline>>();
  EXPECT_EQ((run_program<Case<TypeParam, Inline>>({.delay_seed = 1})), expected);
  for (const std::uint32_t seed : {0U, 2U, 3U}) {
    EXPECT_EQ((run_program<Case<TypeParam, InProcess>>({.delay_seed = seed})), expected) << seed;
  }
}

TYPED_TEST(Determinism, HoldsWhateverTheDelaysOfAnyProcess) {
  const Bytes expected = run_program<Case<TypeParam, Inline>>();
  for (const std::uint32_t seed : {0U, 4U, 5U}) {
    EXPECT_EQ((run_program<Case<TypeParam, AcrossProcesses>>({.delay_seed = seed})), expected)
        << seed;
  }
}

TYPED_TEST(Determinism, fault_23_HoldsHoweverOftenSignalsInterruptAnyThread) {
  const Bytes expected = run_program<Case<TypeParam, Inline>>();
  for (const bool has_deadlines : {false, true}) {
    // While it is held before step 0, the fake robot counts actions.
    if (has_deadlines && std::is_same_v<TypeParam, FakeDriverTraits>) continue;
    const Circumstances interrupted{.has_deadlines = has_deadlines, .has_interruptions = true};
    const std::int64_t enough = Interruptions::count() + 1000;
    do {
      ASSERT_EQ((run_program<Case<TypeParam, InProcess>>(interrupted)), expected);
      ASSERT_EQ((run_program<Case<TypeParam, AcrossProcesses>>(interrupted)), expected);
    } while (Interruptions::count() < enough);
  }
}

TYPED_TEST(Determinism, fault_71_HoldsHoweverLongTheRobotHasRun) {
  const Bytes expected = run_program<Case<TypeParam, Inline>>();
  for (const int bits : {31, 32, 53}) {
    const Circumstances old{.first_index = (TimeIndex{1} << bits) - kRunSteps / 2};
    EXPECT_EQ((run_program<Case<TypeParam, Inline>>(old)), expected) << bits;
    EXPECT_EQ((run_program<Case<TypeParam, InProcess>>(old)), expected) << bits;
    EXPECT_EQ((run_program<Case<TypeParam, AcrossProcesses>>(old)), expected) << bits;
  }
  // The last steps of all, reached after 146 million years at 1 kHz.
  const Circumstances oldest{.first_index = (TimeIndex{1} << 62U) - kRunSteps - 2};
  EXPECT_EQ((run_program<Case<TypeParam, AcrossProcesses>>(oldest)), expected);
}

TYPED_TEST(Determinism, AnObserverInAThirdProcessSeesTheSame) {
  using Rig = typename AcrossProcesses::Rig<TypeParam>;
  const auto driver = TypeParam::make_driver();
  const CompanionDescription& description = driver->companions()[0];
  Rig rig({.session = {.history = 512, .queue = 64}, .injection = {.delay_seed = 6}});
  const SharedValue<std::uint64_t> seen;
  ChildProcess observer([&] {
    // Reads while the robot runs, from the first step on.
    const auto robot = rig.observe();
    CompanionBytes<typename TypeParam::Robot> companion(robot, description);
    *seen = hash_of(series_of(robot, companion));
    return 0;
  });
  auto robot = rig.connect();
  std::minstd_rand random(7);
  for (TimeIndex t = 0; t < kRunSteps; ++t) {
    sleep_sometimes(random, true);
    robot.append_desired_action(TypeParam::action(t % 50));
  }
  robot.wait_until_time_index(kRunSteps);
  EXPECT_EQ(observer.wait(), 0);
  CompanionBytes<typename TypeParam::Robot> companion(robot, description);
  EXPECT_EQ(*seen, hash_of(series_of(robot, companion)));
}

// With deadlines the robot is held before step 0. During that time the odd robot does not move, and
// the fake one counts the actions.
TEST(Deadlines, fault_62_DoNotChangeTheSeriesOfAProgram) {
  const Bytes expected = run_program<Case<OddDriverTraits, Inline>>();
  EXPECT_EQ((run_program<Case<OddDriverTraits, InProcess>>({.has_deadlines = true})), expected);
  EXPECT_EQ((run_program<Case<OddDriverTraits, AcrossProcesses>>(
                {.delay_seed = 8, .has_deadlines = true})),
            expected);
}

}  // namespace
}  // namespace trifinger::test
