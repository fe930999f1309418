// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/session.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/drivers_of_tests.hpp"
#include "core/fault_of.hpp"
#include "core/named_robot.hpp"
#include "core/odd_robot.hpp"
#include "core/session_layout.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"

// What a session says about itself and about its end.

namespace trifinger {
namespace {

using test::message_of;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// One document has bytes of every kind, including zero. One is empty, and one is larger than a
// page.
const std::vector<Document> kDocuments{
    {"configuration.yml", "application/yaml", std::string("name: robot\n\0\xff", 14)},
    {"nothing", "text/plain", ""},
    {"model.xml", "application/xml", std::string(100'000, 'x')},
};

TEST(SessionDocuments, AreReadAsTheyWereGivenInEverySession) {
  const test::SessionFolder folder;
  const test::NamedRobot robot("robot", {.history = 64, .queue = 64, .documents = kDocuments});
  for (int i = 0; i < 3; ++i) {
    auto user = connect<FakeRobot>("robot");
    EXPECT_EQ(user.session().documents(), kDocuments);
    EXPECT_EQ(Session::open("robot").documents(), kDocuments);
    EXPECT_EQ(robot.host().open().documents(), kDocuments);
    user.finish();
  }
  EXPECT_THAT(Session::open("robot.sensor").documents(), IsEmpty());
}

TEST(SessionInfo, fault_58_SaysWhatTheLoopLacksForRealTime) {
  using Mode = BackendOptions::Mode;
  const RealtimeOptions impossible{
      .priority = 1000, .lock_memory = false, .heap = 0, .keep_cpus_awake = false};
  const auto warnings_of = [](Mode mode, const RealtimeOptions& realtime) {
    FakeDriver driver;
    SessionHost host = SessionHost::anonymous();
    Backend backend(driver, host, {.mode = mode});
    const BackendThread thread(backend, realtime);
    return Frontend<FakeRobot>(host).session().info().realtime_warnings;
  };
  EXPECT_THAT(warnings_of(Mode::kRealTime, impossible),
              ElementsAre(HasSubstr("no real-time priority 1000")));
  EXPECT_THAT(warnings_of(Mode::kRealTime, {.demand = Demand::kOff}),
              ElementsAre("no real-time settings were asked for"));
  EXPECT_THAT(warnings_of(Mode::kNonRealTime, {.demand = Demand::kOff}), IsEmpty());
}

TEST(SessionDocuments, AreNoneUnlessTheyAreGiven) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  EXPECT_THAT(Frontend<FakeRobot>(backend).session().documents(), IsEmpty());
}

// A copy of the state file of a robot with documents, to be changed.
class DamagedDocuments : public ::testing::Test {
 protected:
  DamagedDocuments() {
    const test::NamedRobot robot("robot", {.history = 64, .queue = 64, .documents = kDocuments});
    std::ifstream file(folder_.path() / "trifinger.robot.state", std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(file), {});
  }

  [[nodiscard]] detail::StateHeader& header() {
    return *reinterpret_cast<detail::StateHeader*>(bytes_.data());
  }
  [[nodiscard]] detail::DocumentPlace& document(std::size_t i) {
    auto* const places = bytes_.data() + header().documents.offset;
    return reinterpret_cast<detail::DocumentPlace*>(places)[i];
  }
  [[nodiscard]] std::string message() const {
    std::filesystem::remove(folder_.path() / "trifinger.copy.state");
    std::ofstream(folder_.path() / "trifinger.copy.state", std::ios::binary)
        .write(bytes_.data(), static_cast<std::streamsize>(bytes_.size()));
    return message_of<IncompatibleSession>([] { return Session::open("copy").documents(); });
  }

  test::SessionFolder folder_;
  std::vector<char> bytes_;
};

TEST_F(DamagedDocuments, OutsideOfTheFileAreNotRead) {
  ASSERT_EQ(message(), "nothing");
  document(0).text.offset = bytes_.size() - 3;
  EXPECT_THAT(message(), AllOf(HasSubstr("'copy'"), HasSubstr("outside")));
  document(0).text.offset = ~std::uint64_t{0};
  EXPECT_THAT(message(), HasSubstr("outside"));
}

TEST_F(DamagedDocuments, InAListOfAnotherSizeAreNotRead) {
  ++header().documents.size;
  EXPECT_THAT(message(), HasSubstr("wrong size"));
}

TEST_F(DamagedDocuments, OnTopOfEachOtherAskForNoMoreMemoryThanTheFileHas) {
  // A list in the place of the actions, in which each document is the whole file.
  constexpr std::size_t kCount = 20;
  header().documents = {.offset = header().rings[0].offset,
                        .size = kCount * sizeof(detail::DocumentPlace)};
  const detail::TextPlace everything{.offset = 0, .size = bytes_.size()};
  for (std::size_t i = 0; i < kCount; ++i) document(i) = {everything, everything, everything};
  EXPECT_THAT(message(), HasSubstr("larger than the file"));
}

TEST_F(DamagedDocuments, NoCompanionHasANameThatIsAPath) {
  const auto& companions = header().companions;
  ASSERT_EQ(std::string(bytes_.data() + companions.offset, companions.size), "sensor\n");
  std::memcpy(bytes_.data() + companions.offset, "../../", 6);
  EXPECT_THAT(message(), HasSubstr("'../../'"));
}

TEST(SessionCompanions, AreListedAndSayWhoseTheyAre) {
  const test::SessionFolder folder;
  const test::NamedRobot robot;
  const Session session = Session::open("robot");
  EXPECT_THAT(session.companion_names(), ElementsAre("sensor"));
  const SessionInfo info = session.companion("sensor").info();
  EXPECT_EQ(info.name, "robot.sensor");
  EXPECT_TRUE(info.is_companion);
  EXPECT_EQ(info.robot_session_id, session.info().session_id);
  EXPECT_NE(info.session_id, info.robot_session_id);
  EXPECT_EQ(session.info().robot_session_id, session.info().session_id);
  EXPECT_THAT(session.companion("sensor").companion_names(), IsEmpty());
  EXPECT_THAT(message_of<SessionNotFound>([&] { return session.companion("camera"); }),
              AllOf(HasSubstr("'camera'"), HasSubstr("sensor")));
}

TEST(SessionCompanions, OfALaterSessionAreNotTakenForOurs) {
  const test::SessionFolder folder;
  const test::NamedRobot robot;
  const Session old = Session::open("robot");
  {
    auto user = connect<FakeRobot>("robot");
    user.append_desired_action({});
  }
  auto next = connect<FakeRobot>("robot");
  EXPECT_THROW(static_cast<void>(old.companion("sensor")), RobotStopped);
}

TEST(SessionObserver, ReadsASessionThatWasReplacedLongAgo) {
  const test::SessionFolder folder;
  const test::NamedRobot robot;
  const Session session = Session::open("robot");
  const Session sensor = session.companion("sensor");
  auto user = connect<FakeRobot>("robot");
  test::run_steps<test::FakeDriverTraits>(user, 0, 9);
  user.finish();
  static_cast<void>(connect<FakeRobot>("robot").latest_observation());

  const Frontend<FakeRobot> observer(session);
  EXPECT_EQ(observer.get_observation(10).applied_actions, 10);
  EXPECT_EQ(observer.fault(), (Fault{Fault::Code::kFinished, 0, 10}));
  EXPECT_THROW(static_cast<void>(observer.get_observation(11)), RobotStopped);
  FakeSensorReading reading;
  EXPECT_TRUE(UntypedFrontend(sensor).get_latest_at(9, &reading, kForever));
  EXPECT_EQ(reading.stamp.arrival_index, 6);
  EXPECT_THROW(Frontend<test::OddRobot>{session}, IncompatibleSession);
}

TEST(SessionObserver, WaitsForWhatTheControllerDoes) {
  const test::SessionFolder folder;
  const test::NamedRobot robot;
  const Frontend<FakeRobot> observer(Session::open("robot"));
  auto user = connect<FakeRobot>("robot");
  test::run_steps<test::FakeDriverTraits>(user, 0, 5);
  EXPECT_EQ(observer.get_observation(6).applied_actions, 6);
}

// --- The orderly stop

using StoppingRigs = ::testing::Types<test::Inline, test::InProcess, test::AcrossProcesses>;
template <class Transport>
class OrderlyStop : public ::testing::Test {};
TYPED_TEST_SUITE(OrderlyStop, StoppingRigs);

TYPED_TEST(OrderlyStop, IsKeptApartFromTheSeries) {
  using Traits = test::FakeDriverTraits;
  typename TypeParam::template Rig<Traits> rig({.injection = {.stop_periods = 5}});
  auto robot = rig.connect();
  const UntypedFrontend observer(robot.session());
  test::run_steps<Traits>(robot, 0, 9);
  robot.finish();
  const Deadline deadline(test::kLong);
  while (!robot.session().info().is_at_rest && !deadline.passed()) std::this_thread::yield();

  test::expect_end(robot, 10, {.code = Fault::Code::kFinished});
  EXPECT_EQ(observer.range(Series::kStopping), std::pair(TimeIndex{0}, TimeIndex{5}));
  for (TimeIndex i = 0; i < 5; ++i) {
    FakeObservation observation;
    ASSERT_TRUE(observer.try_get(Series::kStopping, i, &observation));
    EXPECT_EQ(observation.applied_actions, 10);
  }
}

TEST(OrderlyStop, OfARobotThatStopsAtOnceMeasuresNothing) {
  test::Inline::Rig<test::FakeDriverTraits> rig;
  auto robot = rig.connect();
  test::run_steps<test::FakeDriverTraits>(robot, 0, 2);
  EXPECT_FALSE(robot.session().info().is_at_rest);
  robot.finish();
  const SessionInfo info = robot.session().info();
  EXPECT_TRUE(info.is_at_rest);
  EXPECT_EQ(rig.log().observations, 4);
  EXPECT_EQ(UntypedFrontend(robot.session()).range(Series::kStopping).second, 0);
}

TEST(OrderlyStop, KeepsTheNewestWhenItTakesLong) {
  test::Inline::Rig<test::FakeDriverTraits> rig(
      {.session = {.history = 16, .queue = 16}, .injection = {.stop_periods = 100}});
  auto robot = rig.connect();
  robot.finish();
  EXPECT_EQ(UntypedFrontend(robot.session()).range(Series::kStopping),
            std::pair(TimeIndex{84}, TimeIndex{100}));
}

// --- Drivers that have no further steps

class ShortDriver final : public Driver<FakeRobot> {
 public:
  static constexpr TimeIndex kSteps = 10;

  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport prepare(TimeIndex) noexcept override {
    state_ = {};
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport get_latest_observation(
      FakeObservation& observation) noexcept override {
    observation = state_;
    return state_.applied_actions == kSteps ? DriverReport::end() : DriverReport::ready();
  }
  [[nodiscard]] DriverReport apply_action(const FakeAction& desired,
                                          FakeAction& applied) noexcept override {
    applied = desired;
    ++state_.applied_actions;
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport hold(const FakeObservation&, FakeAction&) noexcept override {
    return DriverReport::ready();
  }

 private:
  FakeObservation state_;
};

struct ShortDriverTraits {
  using Robot = FakeRobot;

  static std::unique_ptr<UntypedDriver> make_driver() { return std::make_unique<ShortDriver>(); }
  static FakeAction action(TimeIndex) { return {}; }
};

template <class Transport>
class ExhaustedDriver : public ::testing::Test {};
TYPED_TEST_SUITE(ExhaustedDriver, StoppingRigs);

TYPED_TEST(ExhaustedDriver, EndsItsSessionWithoutAFault) {
  typename TypeParam::template Rig<ShortDriverTraits> rig;
  {
    auto robot = rig.connect();
    for (int i = 0; i < 10; ++i) robot.append_desired_action({});
    // The step is too late if a separate back-end has ended before.
    const bool is_left_out =
        test::code_of([&] { robot.append_desired_action({}); }) == Fault::Code::kNone;
    EXPECT_EQ(robot.get_observation(10).applied_actions, 10);
    EXPECT_EQ(test::code_of([&] { return robot.get_observation(11); }), Fault::Code::kExhausted);
    test::expect_end(robot, 10, {.code = Fault::Code::kExhausted});
    EXPECT_EQ(test::code_of([&] { robot.finish(); }),
              is_left_out ? Fault::Code::kExhausted : Fault::Code::kNone);
  }
  // The next session begins at once.
  auto robot = rig.connect();
  test::run_steps<ShortDriverTraits>(robot, 0, 9);
  robot.finish();
  test::expect_end(robot, 10, {.code = Fault::Code::kExhausted});
}

}  // namespace
}  // namespace trifinger
