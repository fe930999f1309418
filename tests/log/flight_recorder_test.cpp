// SPDX-License-Identifier: BSD-3-Clause
#include "log/flight_recorder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "core/session_layout.hpp"
#include "log/recordings.hpp"
#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::log {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);
const std::vector<Document> kDocuments{{"configuration.yml", "application/yaml", "name: fake\n"},
                                       {"model.xml", "application/xml", "<mujoco/>"}};

std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry);
  return files;
}

// A fake robot whose user never stops by itself.
class FlightRecorderTest : public ::testing::Test {
 protected:
  // Runs until the driver faults at action `steps`, or finishes there if `has_fault` is false.
  void run_session(TimeIndex steps, bool has_fault = true) {
    FakeDriver driver({.stop_periods = 5,
                       .sensor_period = 4,
                       .sensor_delay = 2,
                       .action_fault_after = has_fault ? steps : -1});
    SessionHost host =
        SessionHost::anonymous({.history = 256, .queue = 16, .documents = kDocuments});
    Backend backend(driver, host);
    backend.follow(recorder_);
    robot_.emplace(backend);
    session_.emplace(robot_->session());
    sensor_.emplace(robot_->companion("sensor"));
    try {
      for (TimeIndex t = 0; t <= steps; ++t) {
        if (t == steps && !has_fault) break;
        robot_->append_desired_action({.setpoint = static_cast<double>(t)});
        static_cast<void>(robot_->get_status(t));
      }
      robot_->finish();
    } catch (const RobotStopped&) {
      // The test expects this end.
    }
    robot_.reset();
  }

  test::Folder folder_;
  FlightRecorder recorder_{{.folder = folder_.path(), .length = 100 * kPeriod, .max_files = 3}};
  std::optional<Frontend<FakeRobot>> robot_;
  std::optional<Session> session_;
  std::optional<UntypedFrontend> sensor_;
};

// Checks that the log has the steps [first, steps) of `session` bit for bit.
void expect_same_steps(const Log& log, const Session& session, TimeIndex first, TimeIndex steps) {
  const LoggedRobot<FakeRobot> logged(log);
  const Frontend<FakeRobot> robot(session);
  EXPECT_EQ(logged.session().steps(), steps);
  EXPECT_EQ(logged.session().range(Series::kAppliedAction), std::pair(first, steps));
  EXPECT_THAT(logged.session().gaps(), IsEmpty());
  for (TimeIndex t = first; t < steps; ++t) {
    ASSERT_TRUE(test::same_bytes(logged.get_observation(t), robot.get_observation(t))) << t;
    ASSERT_TRUE(test::same_bytes(logged.get_status(t), robot.get_status(t))) << t;
    ASSERT_TRUE(test::same_bytes(logged.get_desired_action(t), robot.get_desired_action(t))) << t;
    ASSERT_TRUE(test::same_bytes(logged.get_applied_action(t), robot.get_applied_action(t))) << t;
  }
}

TEST_F(FlightRecorderTest, LeavesTheLastSecondsBeforeAFaultAsTheyWere) {
  run_session(150);
  const auto left = recorder_.write();
  ASSERT_THAT(left, SizeIs(1));
  EXPECT_EQ(left[0].error, "");
  const Log log(left[0].file);
  EXPECT_TRUE(log.is_finished());
  expect_same_steps(log, *session_, 50, 150);

  const LoggedRobot<FakeRobot> logged(log);
  EXPECT_EQ(logged.session().fault(),
            (Fault{Fault::Code::kDriver, FakeDriver::kInjectedFault, 150}));
  EXPECT_THAT(logged.session().fault_text(), HasSubstr("a fault was injected"));
  EXPECT_EQ(logged.get_observation(150).applied_actions, 150) << "the observation of the end";
  EXPECT_NE(logged.get_status(150).flags & Status::kEnd, 0U);
  EXPECT_EQ(logged.session().header().documents, kDocuments);
  std::vector<std::string> events;
  for (const Event& event : log.events()) events.push_back(event.text);
  EXPECT_THAT(events, ::testing::Contains(HasSubstr("a fault was injected")));
}

TEST_F(FlightRecorderTest, KnowsOfCompanionsWhatWasKnownAtEachStep) {
  // The reading of step 50 is the one that is known at step 52, the first in the log.
  run_session(152);
  const LoggedRobot<FakeRobot> logged{Log(recorder_.write().at(0).file)};
  const LoggedCompanion<FakeSensorReading> sensor(logged.companion("sensor"));
  for (TimeIndex t = 52; t < 152; ++t) {
    FakeSensorReading expected;
    ASSERT_TRUE(UntypedFrontend(sensor_->session()).get_latest_at(t, &expected, kForever));
    const auto found = sensor.get_latest_at(t);
    ASSERT_TRUE(found) << t;
    EXPECT_TRUE(test::same_bytes(*found, expected)) << t;
  }
}

// An element of the companions "holding" and "stopping".
struct FakeMoment {
  Stamp stamp;
  FakeObservation observation;

  static constexpr auto fields() {
    return std::tuple{field("stamp", &FakeMoment::stamp),
                      field("observation", &FakeMoment::observation)};
  }
};

TEST_F(FlightRecorderTest, KeepsTheOrderlyStopAndWhatWasBeforeStepZero) {
  run_session(50);
  const LoggedRobot<FakeRobot> logged{Log(recorder_.write().at(0).file)};
  const LoggedCompanion<FakeMoment> stopping(logged.companion("stopping"));
  EXPECT_EQ(stopping.session().range(Series::kObservation), std::pair(TimeIndex{0}, TimeIndex{5}));
  std::vector<FakeMoment> moments(5);
  stopping.get_observations(0, moments);
  std::int64_t before = logged.get_status(50).time;
  for (TimeIndex i = 0; i < 5; ++i) {
    const FakeMoment& moment = moments[static_cast<std::size_t>(i)];
    EXPECT_EQ(moment.observation.applied_actions, 50);
    EXPECT_EQ(moment.stamp.arrival_index, 51 + i);
    EXPECT_EQ(moment.stamp.arrival_time - before, kPeriod.count());
    before = moment.stamp.arrival_time;
  }
  const LoggedCompanion<FakeMoment> holding(logged.companion("holding"));
  ASSERT_EQ(holding.session().range(Series::kObservation), std::pair(TimeIndex{0}, TimeIndex{1}));
  FakeMoment last;
  holding.get_observations(0, {&last, 1});
  EXPECT_EQ(last.stamp.arrival_index, -1);
  EXPECT_EQ(last.stamp.arrival_time, logged.get_status(0).time);
}

TEST_F(FlightRecorderTest, LeavesNothingAfterACleanEnd) {
  run_session(50, false);
  EXPECT_THAT(recorder_.write(), IsEmpty());
  EXPECT_THAT(files_in(folder_.path()), IsEmpty());
}

TEST_F(FlightRecorderTest, WritesNothingTwice) {
  run_session(50);
  EXPECT_THAT(recorder_.write(), SizeIs(1));
  EXPECT_THAT(recorder_.write(), IsEmpty());
  EXPECT_THAT(files_in(folder_.path()), SizeIs(1));
}

TEST_F(FlightRecorderTest, LeavesALogOfARobotThatNeverBegan) {
  FakeDriver driver({.observation_fault_after = 0});
  SessionHost host = SessionHost::anonymous({.history = 16, .queue = 16});
  Backend backend(driver, host);
  backend.follow(recorder_);
  backend.begin_session();
  while (backend.advance() != Progress::kEnded) {
  }
  const auto left = recorder_.write();
  ASSERT_THAT(left, SizeIs(1));
  const Log log(left[0].file);
  EXPECT_EQ(log.session().fault(), (Fault{Fault::Code::kDriver, FakeDriver::kInjectedFault, -1}));
  EXPECT_EQ(log.session().steps(), 0);
}

TEST_F(FlightRecorderTest, KeepsFaultsThatFollowEachOtherBeforeItIsAsked) {
  run_session(30);
  run_session(40, false);
  run_session(20);
  const auto left = recorder_.write();
  ASSERT_THAT(left, SizeIs(2));
  EXPECT_EQ(Log(left[0].file).session().steps(), 30);
  EXPECT_EQ(Log(left[1].file).session().steps(), 20);
}

TEST_F(FlightRecorderTest, RemovesTheOldestOfItsOwnAndNothingElse) {
  const std::vector<std::string> own{"fake_2020-01-01_00-00-00_fault.mcap",
                                     "other_2020-01-02_00-00-00_fault.mcap",
                                     "fake_2020-01-03_00-00-00_fault_2.mcap"};
  const std::vector<std::string> foreign{"fake_2019-01-01_00-00-00_000.mcap", "my_fault.mcap",
                                         "fake_2019-01-01_00-00-00_fault.mcap.bak"};
  for (const auto& names : {own, foreign}) {
    for (const std::string& name : names) std::ofstream(folder_ / name) << "x";
  }
  run_session(10);
  run_session(20);
  EXPECT_THAT(recorder_.write(), SizeIs(2));
  EXPECT_FALSE(std::filesystem::exists(folder_ / own[0]));
  EXPECT_FALSE(std::filesystem::exists(folder_ / own[1]));
  EXPECT_TRUE(std::filesystem::exists(folder_ / own[2]));
  for (const std::string& name : foreign) EXPECT_TRUE(std::filesystem::exists(folder_ / name));
  EXPECT_THAT(files_in(folder_.path()), SizeIs(3 + foreign.size()));
}

TEST_F(FlightRecorderTest, KeepsTheNewestAfterTheClockWasSetBack) {
  const std::vector<std::string> earlier{"fake_2999-12-31_23-59-58_fault.mcap",
                                         "fake_2999-12-31_23-59-59_fault.mcap",
                                         "other_2999-12-31_23-59-59_fault.mcap",
                                         // A name that nothing can follow.
                                         "fake_9999-12-31_23-59-59_000.mcap"};
  for (const std::string& name : earlier) std::ofstream(folder_ / name) << "x";
  run_session(10);
  const auto left = recorder_.write();
  ASSERT_THAT(left, SizeIs(1));
  EXPECT_EQ(left[0].file.filename(), "anonymous_3000-01-01_00-00-00_fault.mcap");
  EXPECT_TRUE(std::filesystem::exists(left[0].file));
  EXPECT_FALSE(std::filesystem::exists(folder_ / earlier[0]));
}

TEST_F(FlightRecorderTest, SaysWhyItCouldNotWrite) {
  FlightRecorder nowhere({.folder = folder_ / "missing"});
  FakeDriver driver({.action_fault_after = 0});
  SessionHost host = SessionHost::anonymous({.history = 16, .queue = 16});
  Backend backend(driver, host);
  backend.follow(nowhere);
  {
    Frontend<FakeRobot> robot(backend);
    robot.append_desired_action({});
    EXPECT_THROW(static_cast<void>(robot.get_applied_action(0)), RobotStopped);
  }
  const auto left = nowhere.write();
  ASSERT_THAT(left, SizeIs(1));
  EXPECT_THAT(left[0].error, AllOf(HasSubstr("missing"), HasSubstr("No such file")));
}

TEST_F(FlightRecorderTest, IsFoundByTheSessionThatItBelongsTo) {
  EXPECT_FALSE(find_fault_log(folder_.path(), "anonymous", 1));
  run_session(10);
  const auto left = recorder_.write();
  const std::uint64_t id = Log(left.at(0).file).session().header().session_id;
  EXPECT_EQ(find_fault_log(folder_.path(), "anonymous", id), left.at(0).file);
  EXPECT_FALSE(find_fault_log(folder_.path(), "other", id));
  EXPECT_FALSE(find_fault_log(folder_.path(), "anonymous", id + 1));
  run_session(20);
  const auto second = recorder_.write();
  EXPECT_FALSE(find_fault_log(folder_.path(), "anonymous", id));
}

// --- Rescue

class Rescue : public ::testing::Test {
 protected:
  Rescue() { ::setenv("TRIFINGER_LOG_DIR", logs_.path().c_str(), 1); }

  // Runs a robot as fast as it can, in a separate process, until it is killed.
  static int run_for_ever() {
    FakeDriver driver({.sensor_period = 4, .sensor_delay = 2});
    SessionHost host =
        SessionHost::named("robot", {.history = 256, .queue = 16, .documents = kDocuments});
    Backend backend(driver, host);
    Frontend<FakeRobot> robot(backend);
    for (TimeIndex t = 0;; ++t) {
      robot.append_desired_action({.setpoint = static_cast<double>(t)});
      static_cast<void>(robot.get_status(t));
    }
  }
  // Lets such a robot do some steps and kills it.
  static void leave_a_dead_robot(TimeIndex steps) {
    test::ChildProcess process(run_for_ever);
    const Deadline deadline(std::chrono::seconds(60));
    while (!deadline.passed()) {
      try {
        if (Session::open("robot").info().steps >= steps) break;
      } catch (const Error&) {
        // The robot does not exist yet, or the remains of the previous one are being removed.
      }
      std::this_thread::yield();
    }
    process.kill();
  }

  test::SessionFolder sessions_;
  test::Folder logs_;
};

TEST_F(Rescue, fault_16_SavesWhatAKilledBackendHasLeft) {
  std::mt19937 random(1);
  for (int i = 0; i < 20; ++i) {
    std::filesystem::remove(sessions_.path() / "trifinger.robot.state");
    leave_a_dead_robot(static_cast<TimeIndex>(1 + random() % 3000));
    const Session session = Session::open("robot");
    const TimeIndex steps = session.info().steps;
    const std::filesystem::path file = rescue("robot", std::nullopt, std::chrono::hours(1));
    EXPECT_EQ(file.parent_path(), logs_.path());
    const LoggedRobot<FakeRobot> logged{Log(file)};
    EXPECT_EQ(logged.session().fault().code, Fault::Code::kBackendDied);
    // Everything in the history, except the step in progress.
    const auto [first, end] = logged.session().range(Series::kAppliedAction);
    EXPECT_GE(end, steps - 1);
    EXPECT_GE(end - first, std::min<TimeIndex>(end, 254));
    EXPECT_THAT(logged.session().gaps(), IsEmpty());
    for (TimeIndex t = first; t < end; ++t) {
      ASSERT_EQ(logged.get_observation(t).applied_actions, t);
      ASSERT_EQ(logged.get_desired_action(t).setpoint, static_cast<double>(t));
    }
    EXPECT_EQ(logged.session().header().documents, kDocuments);
    const auto reading =
        LoggedCompanion<FakeSensorReading>(logged.companion("sensor")).get_latest_at(end - 1);
    ASSERT_TRUE(reading || end < 4);
    if (reading) {
      EXPECT_GE(reading->stamp.arrival_index, end - 5);
    }
  }
}

TEST_F(Rescue, RefusesARobotThatIsAlive) {
  test::ChildProcess process(run_for_ever);
  const Deadline deadline(std::chrono::seconds(60));
  std::string message;
  while (message.empty() && !deadline.passed()) {
    try {
      static_cast<void>(rescue("robot", std::nullopt, kPeriod));
    } catch (const InvalidArgument& error) {
      message = error.what();
    } catch (const SessionNotFound&) {
      std::this_thread::yield();
    }
  }
  EXPECT_THAT(message, AllOf(HasSubstr("is alive"), HasSubstr("trifinger record robot")));
  EXPECT_THAT(files_in(logs_.path()), IsEmpty());
}

TEST_F(Rescue, LeavesOutElementsThatAreHalfWritten) {
  leave_a_dead_robot(1000);
  // Damages the memory like a back-end that was writing the slots of two steps.
  const auto path = sessions_.path() / "trifinger.robot.state";
  test::Bytes bytes = test::read_file(path);
  const auto& header = *reinterpret_cast<const trifinger::detail::StateHeader*>(bytes.data());
  const TimeIndex end = header.ends[3];
  const auto damage = [&](Series series, TimeIndex t) {
    const trifinger::detail::RingPlace& ring = header.rings[static_cast<std::size_t>(series)];
    const auto slot = static_cast<std::uint64_t>(t) % ring.shape.capacity;
    bytes[ring.offset + slot * ring.shape.slot_size()] |= 1;
  };
  damage(Series::kObservation, end - 100);
  damage(Series::kAppliedAction, end - 50);
  std::filesystem::remove(path);
  test::write_file(path, bytes);

  const std::filesystem::path file = logs_ / "chosen.mcap";
  EXPECT_EQ(rescue("robot", file, std::chrono::hours(1)), file);
  const LoggedRobot<FakeRobot> logged{Log(file)};
  std::vector<std::pair<TimeIndex, TimeIndex>> gaps;
  for (const Gap& gap : logged.session().gaps()) gaps.emplace_back(gap.first, gap.last);
  EXPECT_THAT(
      gaps, ::testing::ElementsAre(std::pair(end - 100, end - 100), std::pair(end - 50, end - 50)));
  EXPECT_EQ(logged.get_observation(end - 99).applied_actions, end - 99);
}

TEST_F(Rescue, KnowsWhenThereIsNothing) {
  EXPECT_THROW(static_cast<void>(rescue("robot", std::nullopt, kPeriod)), SessionNotFound);
}

}  // namespace
}  // namespace trifinger::log
