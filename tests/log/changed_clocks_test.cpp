// SPDX-License-Identifier: BSD-3-Clause
#include "support/changed_clocks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "core/named_robot.hpp"
#include "log/recorder_under_test.hpp"
#include "log/recordings.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::test {
namespace {

class RecorderOfChangedClocks : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!clocks_.work()) GTEST_SKIP() << "the library does not ask our clock_gettime";
  }

  ChangedClocks clocks_;
  const SessionFolder sessions_;
  const Folder logs_;
};

TEST_F(RecorderOfChangedClocks, fault_55_TellsTheNewOffsetAndKeepsTheTimeOfTheSteps) {
  FakeDriver driver;
  SessionHost host = SessionHost::named("robot");
  Backend backend(driver, host,
                  {.mode = BackendOptions::Mode::kRealTime,
                   .max_action_repeats = 1'000'000'000,
                   .max_skipped_ticks = 1'000'000'000});
  const BackendThread thread(backend);
  RecorderUnderTest recorder({"robot"}, {.folder = logs_.path(), .keep_free = 0});
  Frontend<FakeRobot> robot(host);
  robot.append_desired_action({});
  recorder.wait_for_step(20);
  clocks_.set_wall_ahead(std::chrono::hours(1));
  recorder.wait_for_event("the wall clock has moved by 3");
  recorder.wait_for_step(robot.current_time_index() + 20);
  // `finish` comes later: after it, the next session may or may not be in the log.
  recorder.stop();
  EXPECT_EQ(recorder.count_events("the wall clock has moved"), 1U) << recorder.all_events();

  const log::Log log(logs_.path());
  const std::vector<log::Event> events = log.events();
  EXPECT_TRUE(std::ranges::any_of(events, [](const log::Event& event) {
    return event.text.find("minus the monotonic clock it is now") != std::string::npos;
  }));
  ASSERT_EQ(log.sessions().size(), 1U);
  log::SeriesReader reader = log.sessions().front().read({});
  std::vector<TimeIndex> indices(10'000);
  std::vector<std::int64_t> times(indices.size());
  const std::size_t steps = reader.read(indices.size(), {indices.data(), times.data(), {}});
  ASSERT_GT(steps, 20U);
  for (std::size_t i = 1; i < steps; ++i) {
    EXPECT_GT(times[i], times[i - 1]);
    EXPECT_LT(times[i] - times[i - 1], Nanoseconds(std::chrono::minutes(30)).count());
  }
}

// Takes steps in a session, until they are recorded, and ends it. Returns its number.
std::uint64_t take_steps(Frontend<FakeRobot> robot, RecorderUnderTest& recorder, TimeIndex count) {
  for (TimeIndex i = 0; i < count; ++i)
    static_cast<void>(robot.get_status(robot.append_desired_action({.setpoint = 1.0})));
  recorder.wait_for_step(count);
  robot.finish();
  return robot.session().info().session_id;
}

TEST_F(RecorderOfChangedClocks, ANewerRecordingIsTheNewestAfterTheClockWasSetBack) {
  std::vector<std::filesystem::path> files;
  for (const int hours : {2, 0, 1}) {
    clocks_.set_wall_ahead(std::chrono::hours(hours));
    const NamedRobot backend("robot", {});
    RecorderUnderTest recorder({"robot"}, {.folder = logs_.path(), .keep_free = 0});
    const std::uint64_t id = take_steps(connect<FakeRobot>("robot"), recorder, 10);
    recorder.stop();
    const log::Log newest(logs_.path());
    EXPECT_EQ(newest.session().header().session_id, id);
    files.push_back(newest.files().front());
  }
  // People sort files by their names.
  EXPECT_TRUE(std::ranges::is_sorted(files));
}

TEST_F(RecorderOfChangedClocks, ANewerSessionIsTheNewestAfterTheClockWasSetBack) {
  const NamedRobot backend("robot", {});
  RecorderUnderTest recorder({"robot"}, {.folder = logs_.path(), .keep_free = 0});
  std::uint64_t last = 0;
  TimeIndex count = 0;
  for (const int hours : {2, 0, 1}) {
    auto robot = connect<FakeRobot>("robot");
    // The next session begins when this one has ended.
    clocks_.set_wall_ahead(std::chrono::hours(hours));
    // The recorder's position is that of this session, since it is longer than the one before.
    last = take_steps(std::move(robot), recorder, count += 10);
  }
  recorder.stop();
  const log::Log log(logs_.path());
  const std::vector<log::LoggedSession> sessions = log.sessions();
  EXPECT_FALSE(std::ranges::is_sorted(
      sessions, {}, [](const log::LoggedSession& session) { return session.header().created; }));
  EXPECT_EQ(log.session().header().session_id, last);
}

}  // namespace
}  // namespace trifinger::test
