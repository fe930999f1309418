// SPDX-License-Identifier: BSD-3-Clause
#include "log/recorder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/named_robot.hpp"
#include "core/session_place.hpp"
#include "log/recorder_under_test.hpp"
#include "log/recordings.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::test {
namespace {

using log::Recorder;
using log::RecorderOptions;
using Range = std::pair<TimeIndex, TimeIndex>;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Appends `count` actions and waits for the last.
void step(Frontend<FakeRobot>& robot, TimeIndex count) {
  TimeIndex t = -1;
  for (TimeIndex i = 0; i < count; ++i) {
    t = robot.append_desired_action({.setpoint = 0.25 * static_cast<double>(i)});
  }
  static_cast<void>(robot.get_status(t));
}

class RecorderTest : public ::testing::Test {
 protected:
  [[nodiscard]] RecorderOptions options() const {
    RecorderOptions options;
    options.folder = logs_.path();
    options.keep_free = 0;
    return options;
  }
  // Options for recorders that do not search a name.
  [[nodiscard]] RecorderOptions follower_options() const {
    RecorderOptions following = options();
    following.is_follower = true;
    return following;
  }
  [[nodiscard]] Recorded recorded() const { return Recorded(logs_.path()); }

  SessionFolder sessions_;
  Folder logs_;
};

TEST_F(RecorderTest, HasTheNumbersThatTheSeriesHave) {
  constexpr TimeIndex kSteps = 1000;
  RecorderUnderTest recorder({"robot"}, options());
  const NamedRobot backend("robot", {.history = 4096});
  auto robot = connect<FakeRobot>("robot");
  step(robot, kSteps);
  const Companion<FakeSensorReading> sensor(robot.companion("sensor"));
  recorder.wait_for_step(kSteps);  // who searches names may miss a session that ends earlier
  robot.finish();
  recorder.wait_for_event("robot: the controller finished");
  recorder.stop();

  const log::Log log(recorded().files);
  const log::LoggedRobot<FakeRobot> logged(log.sessions().front());
  EXPECT_EQ(logged.session().steps(), kSteps);
  EXPECT_EQ(logged.session().fault(), robot.fault());
  for (TimeIndex t = 0; t < kSteps; ++t) {
    ASSERT_EQ(logged.get_desired_action(t).setpoint, robot.get_desired_action(t).setpoint);
    ASSERT_EQ(logged.get_applied_action(t).setpoint, robot.get_applied_action(t).setpoint);
    ASSERT_EQ(logged.get_status(t).time, robot.get_status(t).time);
    ASSERT_EQ(logged.get_observation(t).applied_actions, robot.get_observation(t).applied_actions);
  }
  EXPECT_EQ(logged.get_observation(kSteps).applied_actions,
            robot.get_observation(kSteps).applied_actions);
  EXPECT_EQ(logged.get_status(kSteps).flags, robot.get_status(kSteps).flags);

  const log::LoggedCompanion<FakeSensorReading> logged_sensor(logged.companion("sensor"));
  for (TimeIndex t = 0; t < kSteps; t += 7) {
    const auto expected = sensor.get_latest_at(t);
    const auto found = logged_sensor.get_latest_at(t);
    ASSERT_EQ(found.has_value(), expected.has_value());
    if (expected) {
      ASSERT_EQ(found->applied_actions, expected->applied_actions);
    }
  }
}

TEST_F(RecorderTest, IsThereBeforeTheRobot) {
  RecorderUnderTest recorder({"robot"}, options());
  const NamedRobot backend("robot", {});
  auto robot = connect<FakeRobot>("robot");
  step(robot, 100);
  recorder.wait_for_step(100);
  recorder.stop();
  EXPECT_EQ(recorded().newest().steps.size(), 100);
  EXPECT_THAT(recorded().newest().holes(), IsEmpty());
}

TEST_F(RecorderTest, BeginsWithWhatTheHistoryHoldsOfASessionThatRuns) {
  const NamedRobot backend("robot", {.history = 64, .queue = 64});
  auto robot = connect<FakeRobot>("robot");
  step(robot, 200);
  RecorderUnderTest recorder({"robot"}, options());
  recorder.wait_for_step(200);
  recorder.stop();
  const Recorded::Session session = recorded().newest();
  EXPECT_GE(session.steps.front(), 200 - 64);
  EXPECT_LE(session.steps.front(), 200 - 32);
  EXPECT_EQ(session.steps.back(), 199);
  EXPECT_THAT(session.holes(), IsEmpty());
  EXPECT_THAT(session.gaps, IsEmpty());
}

TEST_F(RecorderTest, FollowsOneSessionAfterTheOther) {
  RecorderUnderTest recorder({"robot"}, options());
  const NamedRobot backend("robot", {});
  for (int i = 1; i <= 5; ++i) {
    auto robot = connect<FakeRobot>("robot");
    step(robot, 10 * i);
    recorder.wait_for_step(10 * i);
    robot.finish();
  }
  recorder.stop();
  const Recorded log = recorded();
  ASSERT_GE(log.order.size(), 5);
  for (std::size_t i = 0; i < 5; ++i) {
    const auto& session = log.sessions.at(log.order[i]);
    EXPECT_EQ(session.steps.size(), 10 * (i + 1));
    EXPECT_EQ(session.end_messages, 1);
    ASSERT_TRUE(session.ends.contains("robot"));
    EXPECT_EQ(session.ends.at("robot").at("fault"), "finished");
    EXPECT_EQ(session.ends.at("robot").at("steps"), std::to_string(session.steps.size()));
    EXPECT_EQ(session.ends.at("robot").at("observations"),
              std::to_string(session.steps.size() + 1));
  }
}

TEST_F(RecorderTest, AsAFollowerLosesNothingOfASimulationAsFastAsItCan) {
  constexpr TimeIndex kSteps = 50'000;
  RecorderUnderTest recorder({"robot"}, follower_options());
  const NamedRobot backend("robot", {.history = 256, .queue = 256}, kPatient, &*recorder);
  auto robot = connect<FakeRobot>("robot");
  step(robot, kSteps);
  robot.finish();
  recorder.stop();
  const Recorded::Session session = recorded().first();
  EXPECT_EQ(session.steps.size(), kSteps);
  EXPECT_TRUE(session.is_ordered());
  EXPECT_THAT(session.holes(), IsEmpty());
  EXPECT_THAT(session.gaps, IsEmpty());
  EXPECT_EQ(session.companions.at("robot.sensor").size(), kSteps / 4);
  EXPECT_EQ(recorder->state().lost_steps, 0);
}

TEST_F(RecorderTest, AsAFollowerMissesNoSessionHoweverShort) {
  constexpr std::size_t kSessions = 200;
  RecorderUnderTest recorder({"robot"}, follower_options());
  {
    const NamedRobot backend("robot", {.history = 16, .queue = 16}, kPatient, &*recorder);
    for (std::size_t i = 0; i < kSessions; ++i) {
      auto robot = connect<FakeRobot>("robot");
      step(robot, 1);
      robot.finish();
    }
  }
  recorder.stop();
  const Recorded log = recorded();
  std::size_t whole = 0;
  for (const auto& [id, session] : log.sessions) {
    if (session.steps.size() == 1) ++whole;
  }
  EXPECT_EQ(whole, kSessions);
}

TEST_F(RecorderTest, SleepsWhileThereIsNothingToRecord) {
  for (const RecorderOptions& kind : {options(), follower_options()}) {
    RecorderUnderTest recorder({"robot"}, kind);
    const NamedRobot backend("robot", {.history = 16, .queue = 16}, kPatient, &*recorder);
    auto robot = connect<FakeRobot>("robot");
    step(robot, 1);
    recorder.wait_for_step(1);
    // It sleeps for 20 ms between its looks, and shorter only if it was in a hurry before.
    constexpr std::uint64_t kLooks = 20;
    const auto begin = std::chrono::steady_clock::now();
    const std::uint64_t first = recorder->state().progress;
    recorder.wait_until(
        [=](const log::RecorderState& state) { return state.progress >= first + kLooks; });
    EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(200));
  }
}

TEST_F(RecorderTest, SaysHowManySessionsItHasMissed) {
  Disk disk;
  RecorderOptions slow = options();
  slow.open_file = disk.opener();
  RecorderUnderTest recorder({"robot"}, slow);
  const NamedRobot backend("robot", {});
  {
    auto robot = connect<FakeRobot>("robot");
    recorder.wait_until([](const auto& state) { return state.robots[0].session_id != 0; });
    // Before the step: otherwise it may be on the disk already, and nothing else is appended.
    disk.hold();
    step(robot, 1);
    disk.wait_for_append();
    robot.finish();
  }
  // The recorder does not look while an append hangs.
  for (int i = 0; i < 3; ++i) {
    auto robot = connect<FakeRobot>("robot");
    step(robot, 1);
    robot.finish();
  }
  auto robot = connect<FakeRobot>("robot");
  step(robot, 7);
  disk.let_go();
  recorder.wait_for_step(7);
  recorder.stop();
  EXPECT_EQ(recorder.count_events("3 sessions of robot were over"), 1) << recorder.all_events();
  EXPECT_EQ(recorded().count_events("3 sessions of robot were over"), 1);
}

TEST_F(RecorderTest, RecordsSeveralRobotsWithTheirCompanionsIntoOneFile) {
  RecorderUnderTest recorder({"left", "right"}, options());
  const NamedRobot left("left", {});
  const NamedRobot right("right", {});
  auto left_robot = connect<FakeRobot>("left");
  auto right_robot = connect<FakeRobot>("right");
  step(left_robot, 100);
  step(right_robot, 300);
  recorder.wait_for_step(100, 0);
  recorder.wait_for_step(300, 1);
  recorder.stop();
  const Recorded log = recorded();
  ASSERT_EQ(log.files.size(), 1);
  EXPECT_THAT(log.files[0].filename().string(), ::testing::StartsWith("left+right_"));
  EXPECT_EQ(log.newest("left").steps.size(), 100);
  EXPECT_EQ(log.newest("right").steps.size(), 300);
  EXPECT_EQ(log.newest("left").companions.at("left.sensor").size(), 25);
  EXPECT_EQ(log.newest("right").companions.at("right.sensor").size(), 75);
}

TEST_F(RecorderTest, NamesFilesAfterRobotTimeAndPart) {
  RecorderUnderTest recorder({"robot"}, options());
  const NamedRobot backend("robot", {});
  recorder.wait_until([](const auto& state) { return !state.file.empty(); });
  recorder.stop();
  EXPECT_THAT(recorded().files.at(0).filename().string(),
              ::testing::MatchesRegex(
                  "robot_[0-9]{4}-[0-9]{2}-[0-9]{2}_[0-9]{2}-[0-9]{2}-[0-9]{2}_000\\.mcap"));
  EXPECT_TRUE(recorded().is_finished.at(0));
}

TEST_F(RecorderTest, RotatesBySizeWithoutLosingAStep) {
  RecorderOptions small = follower_options();
  small.rotate_size = 200'000;
  constexpr TimeIndex kSteps = 100'000;
  RecorderUnderTest recorder({"robot"}, small);
  const NamedRobot backend("robot", {}, kPatient, &*recorder);
  auto robot = connect<FakeRobot>("robot");
  step(robot, kSteps);
  robot.finish();
  recorder.stop();
  const Recorded log = recorded();
  ASSERT_GT(log.files.size(), 2);
  for (std::size_t i = 0; i < log.files.size(); ++i) {
    const std::string part = std::to_string(1000 + i).substr(1);
    EXPECT_THAT(log.files[i].stem().string(), ::testing::EndsWith("_" + part));
    EXPECT_TRUE(log.is_finished[i]);
    EXPECT_EQ(log.recordings[i], log.recordings[0]);
  }
  const auto& session = log.first();
  // Each file describes what it holds. The last file may contain only the next session.
  EXPECT_GE(session.headers + 1, log.files.size());
  EXPECT_EQ(session.steps.size(), kSteps);
  EXPECT_THAT(session.holes(), IsEmpty());
  EXPECT_EQ(session.companions.at("robot.sensor").size(), kSteps / 4);
}

TEST_F(RecorderTest, RotatesByTime) {
  RecorderOptions brief = options();
  brief.rotate_time = std::chrono::milliseconds(1);
  RecorderUnderTest recorder({"robot"}, brief);
  const NamedRobot backend("robot", {}, kRealTime);
  auto robot = connect<FakeRobot>("robot");
  robot.append_desired_action({});
  recorder.wait_until(
      [](const auto& state) { return state.file.string().find("_003.mcap") != std::string::npos; });
  recorder.stop();
  EXPECT_THAT(recorded().newest().holes(), IsEmpty());
}

TEST_F(RecorderTest, RemovesItsOldestFilesToStayBelowALimit) {
  RecorderOptions limited = follower_options();
  limited.max_total = 2'000'000;
  write_file(logs_ / "robot_2020-01-01_00-00-00_000.mcap", read_file("/dev/null"));
  write_file(logs_ / "robot_2020-01-01_00-00-00_001.mcap", Bytes(5'000'000, 'x'));  // not ours
  constexpr TimeIndex kSteps = 400'000;
  RecorderUnderTest recorder({"robot"}, limited);
  const NamedRobot backend("robot", {}, kPatient, &*recorder);
  auto robot = connect<FakeRobot>("robot");
  step(robot, kSteps);
  robot.finish();
  recorder.stop();
  EXPECT_TRUE(std::filesystem::exists(logs_ / "robot_2020-01-01_00-00-00_001.mcap"));
  std::filesystem::remove(logs_ / "robot_2020-01-01_00-00-00_001.mcap");
  std::uint64_t total = 0;
  const Recorded log = recorded();
  for (const auto& file : log.files) total += std::filesystem::file_size(file);
  EXPECT_LE(total, limited.max_total);
  EXPECT_GT(total, limited.max_total / 2);
  EXPECT_GT(recorder.count_events("removed "), 0);
  EXPECT_EQ(log.first().steps.back(), kSteps - 1);
  EXPECT_THAT(log.first().holes(), IsEmpty());
}

TEST_F(RecorderTest, LeavesFreeOnTheDiskWhatItIsToldTo) {
  RecorderOptions greedy = options();
  greedy.keep_free = std::uint64_t{1} << 60U;
  RecorderUnderTest recorder({"robot"}, greedy);
  const NamedRobot backend("robot", {});
  recorder.wait_until(
      [](const auto& state) { return state.error.find("free on the disk") != std::string::npos; });
  EXPECT_EQ(recorder.count_events("cannot write: leave "), 1);
  // The end cannot be written either.
  EXPECT_THROW(recorder.stop(), SystemError);
  EXPECT_THAT(recorded().files, IsEmpty());
}

TEST_F(RecorderTest, RefusesASecondRecorderOfTheSameRobotAndFolder) {
  const Recorder first({"left", "robot"}, options());
  try {
    const Recorder second({"robot"}, options());
    FAIL();
  } catch (const log::AlreadyRecorded& error) {
    EXPECT_THAT(error.what(), HasSubstr("robot 'robot' is recorded into " + logs_.path().string()));
    EXPECT_THAT(error.what(), HasSubstr("process " + std::to_string(::getpid())));
  }
  const Recorder other({"other"}, options());
}

// A recorder in a separate process that should end together with another process, which has ended.
class LeftBehind {
 public:
  explicit LeftBehind(RecorderOptions options)
      : process_([this, &options] {
          options.until_process_ends = ipc::ProcessIdentity{.pid = ::getpid(), .start_time = 0};
          const Recorder recorder({"robot"}, options);
          // relaxed, like below: a flag that guards no data.
          has_begun_->store(true, std::memory_order_relaxed);
          while (!may_end_->load(std::memory_order_relaxed)) std::this_thread::yield();
          return 0;
        }) {
    while (!has_begun_->load(std::memory_order_relaxed)) std::this_thread::yield();
  }

  void let_end() { may_end_->store(true, std::memory_order_relaxed); }
  [[nodiscard]] pid_t pid() const noexcept { return process_.pid(); }

 private:
  SharedValue<std::atomic<bool>> has_begun_;
  SharedValue<std::atomic<bool>> may_end_;
  ChildProcess process_;
};

TEST_F(RecorderTest, fault_74_WaitsForARecorderThatIsAboutToEnd) {
  for (int i = 0; i < 20; ++i) {
    LeftBehind other(options());
    const std::jthread ender([&other] { other.let_end(); });
    const Recorder recorder({"robot"}, options());
  }
}

TEST_F(RecorderTest, fault_74_NamesARecorderThatShouldEndAndDoesNot) {
  const LeftBehind other(options());
  EXPECT_THAT(message_of<log::AlreadyRecorded>([this] { return Recorder({"robot"}, options()); }),
              ::testing::AllOf(HasSubstr("whose back-end is gone and which does not finish"),
                               HasSubstr("'kill -9 " + std::to_string(other.pid()) + "'")));
}

TEST_F(RecorderTest, LeavesNothingBesidesItsFiles) {
  {
    const Recorder recorder({"robot"}, options());
  }
  EXPECT_TRUE(std::filesystem::is_empty(logs_.path()));
  const Recorder again({"robot"}, options());
}

TEST_F(RecorderTest, RefusesNamesThatRobotsCannotHave) {
  for (const auto& robots :
       std::vector<std::vector<std::string>>{{}, {""}, {"a/b"}, {"robot.sensor"}, {"a", "a"}}) {
    EXPECT_THROW(Recorder(robots, options()), InvalidArgument);
  }
}

TEST_F(RecorderTest, fault_66_GoesOnWithTheRecordingAfterACleanEnd) {
  const NamedRobot backend("robot", {});
  auto robot = connect<FakeRobot>("robot");
  for (int i = 1; i <= 3; ++i) {
    RecorderUnderTest recorder({"robot"}, options());
    step(robot, 100);
    recorder.wait_for_step(100 * i);
    recorder.stop();
  }
  const Recorded log = recorded();
  ASSERT_EQ(log.files.size(), 3);
  for (const std::string& id : log.recordings) EXPECT_EQ(id, log.recordings.front());
  EXPECT_THAT(log.files[2].stem().string(), ::testing::EndsWith("_002"));
  EXPECT_EQ(log.newest().steps.size(), 300);
  EXPECT_TRUE(log.newest().is_ordered());
  EXPECT_THAT(log.newest().gaps, IsEmpty());
  EXPECT_EQ(log.newest().companions.at("robot.sensor").size(), 75);
}

TEST_F(RecorderTest, BeginsAnotherRecordingIfTheHistoryHasLostWhatComesAfterACleanEnd) {
  const NamedRobot backend("robot", {.history = 64, .queue = 64});
  auto robot = connect<FakeRobot>("robot");
  for (int i = 1; i <= 2; ++i) {
    RecorderUnderTest recorder({"robot"}, options());
    step(robot, 10);
    recorder.wait_for_step(robot.current_time_index());
    recorder.stop();
    step(robot, 500);
  }
  const Recorded log = recorded();
  ASSERT_EQ(log.files.size(), 2);
  EXPECT_NE(log.recordings[0], log.recordings[1]);
  EXPECT_TRUE(log.newest().is_ordered());
  EXPECT_THAT(log.newest().gaps, IsEmpty());  // the recorder was not asked to record them
}

TEST_F(RecorderTest, DoesNotRecordAnEndedSessionTwice) {
  const NamedRobot backend("robot", {}, {.first_action_timeout = kForever});
  {
    auto robot = connect<FakeRobot>("robot");
    step(robot, 10);
  }  // ends the session; the next one begins
  for (int i = 0; i < 2; ++i) {
    RecorderUnderTest recorder({"robot"}, options());
    recorder.wait_until([](const auto& state) { return state.robots[0].session_id != 0; });
    recorder.stop();
  }
  const Recorded log = recorded();
  for (const auto& [id, session] : log.sessions) EXPECT_TRUE(session.is_ordered());
}

TEST_F(RecorderTest, SaysThatABackendWasKilledAndGoesOnWithTheNext) {
  const auto run_backend = [] {
    FakeDriver driver;
    SessionHost host = SessionHost::named("robot");
    Backend backend(driver, host, kRealTime);
    const BackendThread thread(backend);
    Frontend<FakeRobot> robot(host);
    robot.append_desired_action({});
    while (true) robot.wait_until_time_index(1LL << 40U);
    return 0;
  };
  ChildProcess first(run_backend);
  RecorderUnderTest recorder({"robot"}, options());
  recorder.wait_for_step(10);
  const std::uint64_t id = recorder->state().robots[0].session_id;
  first.kill();
  recorder.wait_until([](const auto& state) { return !state.robots[0].is_recording; });
  const NamedRobot second("robot", {});
  auto robot = connect<FakeRobot>("robot");
  step(robot, 20);
  recorder.wait_for_step(20);
  recorder.stop();
  const Recorded log = recorded();
  const auto& session = log.sessions.at(id);
  EXPECT_EQ(session.ends.at("robot").at("fault"), "backend_died");
  EXPECT_EQ(log.newest().steps.size(), 20);
  EXPECT_EQ(session.ends.at("robot").at("steps"), std::to_string(session.steps.size()));
  EXPECT_THAT(session.holes(), IsEmpty());
}

TEST_F(RecorderTest, EndsWithTheBackendIfThatIsWanted) {
  RecorderOptions until_end = options();
  until_end.until_end = true;
  RecorderUnderTest recorder({"robot"}, until_end);
  {
    const NamedRobot backend("robot", {});
    auto robot = connect<FakeRobot>("robot");
    step(robot, 10);
    recorder.wait_for_step(10);
  }
  recorder.join();
  EXPECT_EQ(recorded().sessions.at(recorded().order.at(0)).steps.size(), 10);
  EXPECT_TRUE(recorded().is_finished.at(0));
}

TEST_F(RecorderTest, EndsWithAProcessIfThatIsWanted) {
  ChildProcess child([] { return ::pause(); });
  RecorderOptions until_exit = options();
  until_exit.until_process_ends = ipc::ProcessIdentity{.pid = child.pid(), .start_time = 0};
  // The identity of an ended process with an equal number.
  RecorderUnderTest recorder({"robot"}, until_exit);
  recorder.join();
}

TEST_F(RecorderTest, FlushesTheDisksOwnMemoryNowAndThen) {
  Disk disk;
  RecorderOptions eager = options();
  eager.open_file = disk.opener();
  eager.sync_period = std::chrono::milliseconds(1);
  RecorderUnderTest recorder({"robot"}, eager);
  const NamedRobot backend("robot", {}, kRealTime);
  auto robot = connect<FakeRobot>("robot");
  robot.append_desired_action({});
  recorder.wait_until([&](const auto&) { return disk.syncs() >= 3; });
  recorder.stop();
}

TEST_F(RecorderTest, fault_71_RecordsStepsOfAnyIndex) {
  for (const int bits : {31, 32, 53}) {
    const TimeIndex first = (TimeIndex{1} << bits) - 500;
    FakeDriver driver({.sensor_period = 0});
    SessionHost host = SessionHost::named("robot" + std::to_string(bits));
    host.place().begin_at(first);
    Backend backend(driver, host, kRealTime);
    const BackendThread thread(backend);
    Frontend<FakeRobot> robot(host);
    RecorderUnderTest recorder({"robot" + std::to_string(bits)}, options());
    recorder.wait_until([](const auto& state) { return state.robots[0].session_id != 0; });
    robot.append_desired_action({.setpoint = 1.0});
    recorder.wait_for_step(first + 1000);
    robot.finish();
    recorder.stop();

    const log::Log log(logs_.path());
    const log::LoggedRobot<FakeRobot> recorded(log);
    const auto [begin, end] = recorded.session().range(Series::kAppliedAction);
    // A recorder of a robot that has run for ages cannot know that there was no earlier step.
    EXPECT_LE(begin, first + 1);
    EXPECT_GE(end, first + 1000);
    EXPECT_THAT(recorded.session().gaps(), IsEmpty());
    std::vector<Status> statuses(static_cast<std::size_t>(end - begin));
    recorded.get_statuses(begin, statuses);
    std::int64_t before = -1;
    for (const Status& status : statuses) {
      ASSERT_GT(status.tick, before);
      before = status.tick;
    }
    EXPECT_EQ(recorded.session().fault().time_index, end);
  }
}

TEST_F(RecorderTest, StartsAnotherFileIfSomebodyTakesItsFileAway) {
  RecorderOptions eager = options();
  eager.sync_period = std::chrono::milliseconds(1);
  RecorderUnderTest recorder({"robot"}, eager);
  const NamedRobot backend("robot", {}, kRealTime);
  auto robot = connect<FakeRobot>("robot");
  robot.append_desired_action({});
  recorder.wait_for_step(10);
  const auto file = recorder->state().file;
  std::filesystem::remove(file);
  recorder.wait_until([&](const auto& state) { return !state.file.empty() && state.file != file; });
  recorder.stop();
  EXPECT_EQ(recorder.count_events("was removed or renamed"), 1);
}

}  // namespace
}  // namespace trifinger::test
