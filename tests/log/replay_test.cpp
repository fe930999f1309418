// SPDX-License-Identifier: BSD-3-Clause
#include "log/replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/drivers_of_tests.hpp"
#include "core/fake_robot.hpp"
#include "core/named_robot.hpp"
#include "log/flight_recorder.hpp"
#include "log/recordings.hpp"
#include "support/message_of.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/log/log.hpp"

// A program that runs on a log sees what it saw when the log was recorded.

namespace trifinger::log {
namespace {

using test::message_of;
using test::same_bytes;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr TimeIndex kSteps = 200;

// Everything that can be read of a session, without clock times.
template <class R>
struct AllSeries {
  std::vector<typename R::Observation> observations;
  std::vector<typename R::Action> desired_actions;
  std::vector<AppliedActionOf<R>> applied_actions;
  std::vector<Status> statuses;
  std::vector<std::vector<std::byte>> companion;  // what was known at each step

  friend bool operator==(const AllSeries& one, const AllSeries& other) {
    const auto same = [](const auto& left, const auto& right) {
      return left.size() == right.size() &&
             (left.empty() ||
              std::memcmp(left.data(), right.data(), left.size() * sizeof(left[0])) == 0);
    };
    return same(one.observations, other.observations) &&
           same(one.desired_actions, other.desired_actions) &&
           same(one.applied_actions, other.applied_actions) && same(one.statuses, other.statuses) &&
           one.companion == other.companion;
  }
};

template <class R>
AllSeries<R> series_of(const Frontend<R>& robot, const UntypedFrontend& companion,
                       TimeIndex steps) {
  AllSeries<R> series;
  for (TimeIndex t = 0; t < steps; ++t) {
    series.observations.push_back(robot.get_observation(t));
    series.desired_actions.push_back(robot.get_desired_action(t));
    series.applied_actions.push_back(robot.get_applied_action(t));
    Status status = robot.get_status(t);
    status.time = status.lateness = 0;
    series.statuses.push_back(status);
    std::vector<std::byte> element(companion.session().description().observation.size());
    if (companion.get_latest_at(t, element.data(), kForever)) {
      Stamp stamp;
      std::memcpy(&stamp, element.data(), sizeof(stamp));
      stamp.arrival_time = stamp.capture_time = 0;
      std::memcpy(element.data(), &stamp, sizeof(stamp));
    } else {
      element.clear();
    }
    series.companion.push_back(std::move(element));
  }
  series.observations.push_back(robot.get_observation(steps));
  return series;
}

std::uint64_t hash_of(const void* bytes, std::size_t size, std::uint64_t hash) {
  for (std::size_t i = 0; i < size; ++i) {
    hash = hash * 6364136223846793005ULL +
           std::to_integer<unsigned>(static_cast<const std::byte*>(bytes)[i]) + 1;
  }
  return hash;
}

// A feedback loop: each action depends on the observations, so that one wrong bit changes
// everything after it.
template <class Traits>
void run_program(Frontend<typename Traits::Robot>& robot, const UntypedFrontend& companion,
                 TimeIndex steps) {
  std::vector<std::byte> element(companion.session().description().observation.size());
  std::uint64_t knowledge = 0;
  for (TimeIndex t = 0; t < steps; ++t) {
    ASSERT_EQ(robot.append_desired_action(Traits::action(static_cast<TimeIndex>(knowledge % 50))),
              t);
    const auto y = robot.get_observation(t);
    knowledge = hash_of(&y, sizeof(y), knowledge);
    // Without the stamp's clocks.
    if (companion.get_latest_at(t, element.data(), kForever)) {
      knowledge =
          hash_of(element.data() + sizeof(Stamp), element.size() - sizeof(Stamp), knowledge);
    }
  }
}

// The fake robot under another type name.
struct LaterRobot {
  static constexpr std::string_view kType = "later";
  using Action = FakeAction;
  using Observation = FakeObservation;
};

template <class Traits>
class ReplayTest : public ::testing::Test {
 protected:
  using Robot = typename Traits::Robot;

  ReplayTest() : driver_(Traits::make_driver()), backend_(*driver_, host_) {
    Frontend<Robot> robot(backend_);
    const Session session = robot.session();
    const UntypedFrontend companion = robot.companion(companion_name());
    run_program<Traits>(robot, companion, kSteps);
    robot.finish();
    recorded_ = series_of(robot, companion, kSteps);
    write_last(session, {companion.session()}, folder_ / "log.mcap", std::chrono::hours(1), "");
  }

  [[nodiscard]] std::string companion_name() const { return driver_->companions()[0].name; }
  [[nodiscard]] LoggedSession session() const { return Log(folder_ / "log.mcap").session(); }
  [[nodiscard]] AllSeries<Robot> replayed_by(Frontend<Robot>& robot, TimeIndex steps) const {
    const UntypedFrontend companion = robot.companion(companion_name());
    run_program<Traits>(robot, companion, steps);
    robot.finish();
    return series_of(robot, companion, steps);
  }

  test::Folder folder_;
  std::unique_ptr<UntypedDriver> driver_;
  SessionHost host_{SessionHost::anonymous({.history = 1024, .queue = 1024})};
  Backend backend_;
  AllSeries<Robot> recorded_;
};

using Drivers = ::testing::Types<test::FakeDriverTraits, test::OddDriverTraits>;
TYPED_TEST_SUITE(ReplayTest, Drivers);

TYPED_TEST(ReplayTest, GivesTheSameProgramTheSameSeriesBitForBit) {
  const Replay replay(this->session());
  EXPECT_EQ(replay.steps(), kSteps);
  for (int i = 0; i < 2; ++i) {
    auto robot = replay.connect<typename TypeParam::Robot>();
    const auto replayed = this->replayed_by(robot, kSteps);
    EXPECT_EQ(replayed, this->recorded_) << "session " << i;
  }
}

TYPED_TEST(ReplayTest, AnswersEveryUserWithWhatWasRecordedAndFlagsWhereHeDiffers) {
  auto robot = Replay(this->session()).connect<typename TypeParam::Robot>();
  for (TimeIndex t = 0; t < kSteps; ++t) {
    auto action = this->recorded_.desired_actions[static_cast<std::size_t>(t)];
    // Change one bit of every third action.
    if (t % 3 == 0) reinterpret_cast<unsigned char*>(&action)[0] ^= 1U;
    robot.append_desired_action(action);
    static_cast<void>(robot.get_observation(t));
  }
  robot.finish();
  for (TimeIndex t = 0; t < kSteps; ++t) {
    const auto i = static_cast<std::size_t>(t);
    EXPECT_TRUE(same_bytes(robot.get_observation(t), this->recorded_.observations[i]));
    EXPECT_TRUE(same_bytes(robot.get_applied_action(t), this->recorded_.applied_actions[i]));
    EXPECT_EQ((robot.get_status(t).flags & Status::kActionRejected) != 0, t % 3 == 0) << t;
  }
}

TYPED_TEST(ReplayTest, EndsAfterTheLastStepWithoutAFaultAndCanBeginAgain) {
  const Replay replay(this->session());
  {
    auto robot = replay.connect<typename TypeParam::Robot>();
    std::optional<Fault> fault;
    try {
      for (TimeIndex t = 0;; ++t) {
        robot.append_desired_action(TypeParam::action(0));
        static_cast<void>(robot.get_observation(t));
      }
    } catch (const RobotStopped& stopped) {
      fault = stopped.fault();
    }
    ASSERT_TRUE(fault);
    EXPECT_EQ(fault->code, Fault::Code::kExhausted);
    EXPECT_EQ(fault->time_index, kSteps);
    EXPECT_FALSE(fault->needs_recovery());
    // There are N applied actions, and N + 1 observations and statuses.
    EXPECT_TRUE(same_bytes(robot.get_observation(kSteps), this->recorded_.observations.back()));
    EXPECT_NE(robot.get_status(kSteps).flags & Status::kEnd, 0U);
    EXPECT_EQ(robot.session().info().steps, kSteps);
  }
  auto robot = replay.connect<typename TypeParam::Robot>();
  EXPECT_TRUE(same_bytes(robot.latest_observation(), this->recorded_.observations.front()));
}

TYPED_TEST(ReplayTest, OfAPartBeginsThere) {
  constexpr TimeIndex kFirst = 90;
  constexpr TimeIndex kLast = 150;
  const Replay replay(this->session(), {.first = kFirst, .last = kLast});
  ASSERT_EQ(replay.steps(), kLast - kFirst);
  auto robot = replay.connect<typename TypeParam::Robot>();
  const UntypedFrontend companion = robot.companion(this->companion_name());
  std::vector<std::byte> element(companion.session().description().observation.size());
  for (TimeIndex t = 0; t < replay.steps(); ++t) {
    const auto i = static_cast<std::size_t>(kFirst + t);
    robot.append_desired_action(this->recorded_.desired_actions[i]);
    EXPECT_TRUE(same_bytes(robot.get_observation(t), this->recorded_.observations[i]));
    // This includes elements that became known before the part began.
    ASSERT_TRUE(companion.get_latest_at(t, element.data(), kForever));
    EXPECT_EQ(std::memcmp(element.data() + sizeof(Stamp),
                          this->recorded_.companion[i].data() + sizeof(Stamp),
                          element.size() - sizeof(Stamp)),
              0)
        << t;
    Stamp recorded;
    std::memcpy(&recorded, this->recorded_.companion[i].data(), sizeof(recorded));
    Stamp stamp;
    std::memcpy(&stamp, element.data(), sizeof(stamp));
    EXPECT_EQ(stamp.capture_index, recorded.capture_index - kFirst);
    EXPECT_EQ(robot.get_status(t).flags, 0U);
  }
  robot.finish();
}

TYPED_TEST(ReplayTest, InRealTimeHoldsBeforeTheFirstStep) {
  ReplayDriver driver(this->session());
  SessionHost host = SessionHost::anonymous(driver.session_options());
  ManualClock clock;
  BackendOptions options = driver.backend_options();
  options.mode = BackendOptions::Mode::kRealTime;
  Backend backend(driver, host, options, clock);
  const BackendThread thread(backend);
  Frontend<typename TypeParam::Robot> robot(host);
  clock.tick(options.period, 20);
  EXPECT_TRUE(same_bytes(robot.latest_observation(), this->recorded_.observations.front()));
  // The user may send any actions, even those from the beginning of the log.
  for (const auto& action : this->recorded_.desired_actions) robot.append_desired_action(action);
  clock.run_free();
  for (TimeIndex t = 0; t < kSteps; ++t) {
    EXPECT_TRUE(same_bytes(robot.get_observation(t),
                           this->recorded_.observations[static_cast<std::size_t>(t)]));
    EXPECT_EQ(robot.get_status(t).flags & Status::kActionRejected, 0U) << t;
  }
}

TYPED_TEST(ReplayTest, OffersTheSameSessionAsTheRobot) {
  auto robot = Replay(this->session()).connect<typename TypeParam::Robot>();
  const RobotTypes& types = this->driver_->description();
  EXPECT_EQ(robot.session().description().default_action, types.default_action);
  EXPECT_EQ(robot.session().companion_names(), std::vector{this->companion_name()});
  EXPECT_THROW(static_cast<void>(Replay(this->session()).connect<LaterRobot>()),
               IncompatibleSession);
}

// --- Incomplete logs

class ReplayOfOdd : public ::testing::Test {
 protected:
  // Writes the steps [0, 50) and [`from`, 100), and the end if `has_end`.
  [[nodiscard]] LoggedSession write(TimeIndex from, bool has_end) {
    mcap::FileSink sink = mcap::FileSink::create(folder_ / "log.mcap");
    LogWriter writer(sink, {});
    const std::size_t number = writer.begin_session(recorded_.header);
    test::write_steps(writer, number, recorded_, 0, 50);
    if (from > 50) writer.write_gap(number, 50, from - 1, "a test left them out");
    test::write_steps(writer, number, recorded_, from, 100);
    if (has_end) test::write_end(writer, number, recorded_);
    writer.finish();
    return Log(folder_ / "log.mcap").session();
  }

  test::Folder folder_;
  test::OddSession recorded_{test::random_session(1, 100)};
};

TEST_F(ReplayOfOdd, WithoutTheLastObservationEndsAStepEarlier) {
  const Replay replay(write(50, false));
  EXPECT_EQ(replay.steps(), 99);
  auto robot = replay.connect<test::OddRobot>();
  for (TimeIndex t = 0; t < 99; ++t) robot.append_desired_action({});
  robot.finish();
  EXPECT_TRUE(same_bytes(robot.get_observation(99), recorded_.observations[99]));
}

TEST_F(ReplayOfOdd, TellsOfRejectedActionsLostFramesAndAgesAsRecorded) {
  auto robot = Replay(write(50, true)).connect<test::OddRobot>();
  for (const auto& action : recorded_.desired_actions) robot.append_desired_action(action);
  robot.finish();
  for (TimeIndex t = 0; t < 100; ++t) {
    const Status& recorded = recorded_.statuses[static_cast<std::size_t>(t)];
    EXPECT_EQ(robot.get_status(t).measurement_age, recorded.measurement_age);
    EXPECT_EQ(robot.get_status(t).lost_frames, recorded.lost_frames);
    EXPECT_EQ(robot.get_status(t).flags & Status::kActionRejected,
              recorded.flags & Status::kActionRejected);
  }
}

TEST_F(ReplayOfOdd, RefusesAGapButTakesAPartWithoutOne) {
  const LoggedSession session = write(60, true);
  EXPECT_THROW(Replay{session}, NotInLog);
  // The lamp was read at step 59, which is missing, and then at step 62.
  EXPECT_THROW(Replay(session, {.first = 60}), NotInLog);
  EXPECT_EQ(Replay(session, {.first = 62}).steps(), 38);
  EXPECT_EQ(Replay(session, {.last = 49}).steps(), 49);
}

TEST_F(ReplayOfOdd, RefusesStepsThatAreNotThere) {
  const LoggedSession session = write(50, true);
  for (const ReplayOptions& part :
       {ReplayOptions{.first = 100}, ReplayOptions{.first = -1}, ReplayOptions{.last = 0},
        ReplayOptions{.first = 20, .last = 20}}) {
    EXPECT_THAT(message_of<InvalidArgument>([&] { return Replay(session, part).steps(); }),
                AllOf(HasSubstr("'odd'"), HasSubstr("0 to 99")));
  }
  EXPECT_THAT(
      message_of<InvalidArgument>([&] { return Replay(session.companion("lamp")).steps(); }),
      HasSubstr("is a companion"));
}

}  // namespace
}  // namespace trifinger::log
