// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/named_robot.hpp"
#include "log/recorder.hpp"
#include "log/recorder_under_test.hpp"
#include "log/recordings.hpp"
#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"
#include "support/soak.hpp"

// fault_20: killing a recorder at any instant costs nothing. A robot runs at 1 kHz in a process of
// its own, and a recorder in another; the recorder is killed and started again and again. The
// robot's steps are the clock of the test.

namespace trifinger::test {
namespace {

using ::testing::IsEmpty;

constexpr BackendOptions kAtOneKilohertz{.mode = BackendOptions::Mode::kRealTime,
                                         .period = std::chrono::milliseconds(1),
                                         .max_action_repeats = 1'000'000'000,
                                         .max_skipped_ticks = 1'000'000'000};

// Their parent ends both processes.
int run_robot(std::size_t history) {
  const NamedRobot backend("robot", {.history = history}, kAtOneKilohertz);
  Frontend<FakeRobot> robot(backend.host());
  while (true) robot.wait_until_time_index(robot.append_desired_action({}) + 10);
}

// Stores its progress in `read`.
int run_recorder(const std::filesystem::path& folder, std::atomic<TimeIndex>& read) {
  log::RecorderOptions options;
  options.folder = folder;
  options.keep_free = 0;
  options.rotate_size = 200'000;  // so that kills also hit the change from one file to the next
  log::Recorder recorder({"robot"}, options);
  std::thread([&recorder, &read] {
    while (true) {
      // relaxed: only a number for the statistics of the test.
      read.store(recorder.state().robots[0].next_step, std::memory_order_relaxed);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }).detach();
  recorder.run();
  return 0;
}

// Returns the robot as soon as it runs.
Frontend<FakeRobot> find_robot() {
  while (true) {
    try {
      auto robot = observe<FakeRobot>("robot");
      robot.wait_until_time_index(0);
      return robot;
    } catch (const SessionNotFound&) {
      std::this_thread::yield();
    }
  }
}

class RecorderKill : public ::testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<ChildProcess> start_recorder() {
    read_->store(0, std::memory_order_relaxed);
    return std::make_unique<ChildProcess>([this] { return run_recorder(logs_.path(), *read_); });
  }
  void wait_for_recorder(TimeIndex step) const {
    while (read_->load(std::memory_order_relaxed) < step) std::this_thread::yield();
  }

  SessionFolder sessions_;
  Folder logs_;
  SharedValue<std::atomic<TimeIndex>> read_;
};

TEST_F(RecorderKill, fault_20_AgainAndAgainCostsNothing) {
  const std::int64_t kills = repetitions(60, 1000);
  ChildProcess backend([] { return run_robot(16384); });
  std::mt19937 random(1);
  const auto robot = find_robot();
  // Number of steps that the files were late, for recorders that had caught up before.
  std::vector<TimeIndex> at_risk;
  ProgressLine progress(kills);
  for (std::int64_t i = 0; i < kills; ++i) {
    progress.update(i);
    const auto recorder = start_recorder();
    const bool is_early = random() % 4 == 0;
    if (!is_early) wait_for_recorder(robot.current_time_index());
    robot.wait_until_time_index(robot.current_time_index() +
                                static_cast<TimeIndex>(random() % 100));
    const TimeIndex now = robot.current_time_index();
    recorder->kill();

    const Recorded log(logs_.path());
    // A recorder that has just begun may have read nothing yet.
    if (log.order.empty()) continue;
    ASSERT_EQ(log.order.size(), 1);
    ASSERT_TRUE(log.first().is_ordered()) << "an index is there twice, after kill " << i;
    ASSERT_THAT(log.first().holes(), IsEmpty()) << "after kill " << i;
    ASSERT_THAT(log.first().gaps, IsEmpty()) << "after kill " << i;
    if (!is_early && !log.first().steps.empty()) {
      at_risk.push_back(now - log.first().steps.back());
    }
  }
  // The last recorder gets everything.
  RecorderUnderTest last({"robot"}, {.folder = logs_.path(), .keep_free = 0});
  const TimeIndex end = robot.current_time_index();
  last.wait_for_step(end);
  last.stop();
  const Recorded log(logs_.path());
  ASSERT_EQ(log.order.size(), 1);
  EXPECT_GE(static_cast<TimeIndex>(log.first().steps.size()), end);
  EXPECT_EQ(log.first().steps.front(), 0);
  EXPECT_TRUE(log.first().is_ordered());
  EXPECT_THAT(log.first().holes(), IsEmpty());
  EXPECT_THAT(log.first().gaps, IsEmpty());
  for (const auto& [name, elements] : log.first().companions) {
    EXPECT_EQ(elements.back() + 1, static_cast<TimeIndex>(elements.size())) << name;
  }
  for (const auto& id : log.recordings) EXPECT_EQ(id, log.recordings.front());

  std::ranges::sort(at_risk);
  ASSERT_FALSE(at_risk.empty());
  const TimeIndex median = at_risk[at_risk.size() / 2];
  const TimeIndex most = at_risk[at_risk.size() * 95 / 100];
  std::printf(
      "%lld kills, %zu files, %zu steps; in danger, had the robot's memory been lost as well: "
      "median "
      "%lld, 95 %% %lld, worst %lld ms\n",
      static_cast<long long>(kills), log.files.size(), log.first().steps.size(),
      static_cast<long long>(median), static_cast<long long>(most),
      static_cast<long long>(at_risk.back()));
}

TEST_F(RecorderKill, fault_20_LeavesAGapWhereTheHistoryIsShorterThanTheAbsence) {
  ChildProcess backend([] { return run_robot(64); });
  const auto robot = find_robot();
  {
    const auto recorder = start_recorder();
    wait_for_recorder(20);
    robot.wait_until_time_index(robot.current_time_index() + 200);
    recorder->kill();
  }
  robot.wait_until_time_index(robot.current_time_index() + 300);
  // This one is stopped in order. On a busy machine it may lose steps at any time, and a kill just
  // then would leave a gap that no steps follow.
  RecorderUnderTest recorder({"robot"}, {.folder = logs_.path(), .keep_free = 0});
  recorder.wait_for_step(robot.current_time_index());
  recorder.stop();
  const Recorded log(logs_.path());
  EXPECT_EQ(log.first().holes(), log.first().reported_holes());
  ASSERT_FALSE(log.first().gaps.empty());
  EXPECT_TRUE(log.first().is_ordered());
  // The first one may have been killed between a gap and its event.
  EXPECT_LE(log.count_losses_of("robot"), log.first().gaps.size());
  EXPECT_GT(log.count_losses_of("robot"), 0U);
}

TEST_F(RecorderKill, fault_20_IsToldIfASessionEndsBeforeTheNextRecorderComes) {
  ChildProcess backend([] {
    const NamedRobot fake("robot", {}, kAtOneKilohertz);
    while (true) {
      Frontend<FakeRobot> robot(fake.host());
      const TimeIndex t = robot.append_desired_action({});
      robot.wait_until_time_index(t + 100);
      robot.finish();
    }
    return 0;
  });
  {
    const auto recorder = start_recorder();
    wait_for_recorder(60);
    recorder->kill();
  }
  const Recorded cut_off(logs_.path());
  const std::uint64_t id = cut_off.order.back();
  const bool has_ended = !cut_off.newest().ends.empty();
  static_cast<void>(find_robot());
  while (Session::open("robot").info().session_id == id) std::this_thread::yield();
  RecorderUnderTest recorder({"robot"}, {.folder = logs_.path(), .keep_free = 0});
  recorder.wait_for_step(20);
  recorder.stop();
  const Recorded log(logs_.path());
  EXPECT_EQ(log.count_events("that session ended without a recorder"), has_ended ? 0 : 1);
  EXPECT_GE(log.order.size(), 2);
}

TEST_F(RecorderKill, fault_20_TogetherWithTheBackendLeavesWhatTheMemoryHolds) {
  const auto backend = std::make_unique<ChildProcess>([] { return run_robot(16384); });
  auto robot = find_robot();
  {
    const auto recorder = start_recorder();
    wait_for_recorder(50);
    recorder->kill();
  }
  robot.wait_until_time_index(robot.current_time_index() + 100);
  backend->kill();
  const TimeIndex steps = robot.session().info().steps;
  RecorderUnderTest recorder({"robot"},
                             {.folder = logs_.path(), .keep_free = 0, .until_end = true});
  recorder.join();
  const Recorded log(logs_.path());
  EXPECT_EQ(static_cast<TimeIndex>(log.first().steps.size()), steps);
  EXPECT_THAT(log.first().holes(), IsEmpty());
  EXPECT_EQ(log.first().ends.at("robot").at("fault"), "backend_died");
}

}  // namespace
}  // namespace trifinger::test
