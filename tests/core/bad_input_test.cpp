// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/types.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/drivers_of_tests.hpp"
#include "core/fault_of.hpp"
#include "core/named_robot.hpp"
#include "core/session_layout.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "ipc/file_lock.hpp"
#include "ipc/shared_memory.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"

// Every mistake of a user or of another process gives an error of its own type, with a helpful
// sentence.

namespace trifinger {
namespace {

using test::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

class BadInput : public ::testing::Test {
 protected:
  test::SessionFolder folder_;
};

using Bytes = std::vector<char>;

Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

void write_file(const std::filesystem::path& path, const Bytes& bytes) {
  // A new file each time, because processes that have mapped the old one keep it.
  std::filesystem::remove(path);
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

TEST_F(BadInput, AnUnknownRobotIsAnsweredWithThoseThereAre) {
  EXPECT_THAT(message_of<SessionNotFound>([] { return connect<FakeRobot>("nobody"); }),
              AllOf(HasSubstr("'nobody'"), HasSubstr("trifinger run")));
  const test::NamedRobot robot("left"), other("right");
  EXPECT_THAT(message_of<SessionNotFound>([] { return connect<FakeRobot>("nobody"); }),
              AllOf(HasSubstr("'nobody'"), HasSubstr("left"), HasSubstr("right")));
}

TEST_F(BadInput, ANameThatCannotBeAFilesIsRefused) {
  for (const std::string name : {"", "a/b", "..", ".", "a b", "robot.", ".robot", "a.b.c", "\n"}) {
    EXPECT_THROW(static_cast<void>(Session::open(name)), InvalidArgument) << "'" << name << "'";
    EXPECT_THROW(static_cast<void>(SessionHost::named(name)), InvalidArgument)
        << "'" << name << "'";
  }
  EXPECT_THROW(static_cast<void>(SessionHost::named(std::string(65, 'x'))), InvalidArgument);
  static_cast<void>(SessionHost::named(std::string(64, 'x')));
}

TEST_F(BadInput, fault_30_AnotherRobotsTypeIsNamed) {
  const test::NamedRobot robot;
  EXPECT_THAT(message_of<IncompatibleSession>([] { return connect<test::OddRobot>("robot"); }),
              AllOf(HasSubstr("'robot'"), HasSubstr("'fake'"), HasSubstr("'odd'")));
  // Users with the right type can still get control after the mistake.
  auto user = connect<FakeRobot>("robot");
  EXPECT_EQ(user.append_desired_action({}), 0);
}

struct LaterAction {
  double setpoint{0.0};
  double gain{0.0};

  static constexpr auto fields() {
    return std::tuple{field("setpoint", &LaterAction::setpoint), field("gain", &LaterAction::gain)};
  }
};
struct LaterFakeRobot {
  static constexpr std::string_view kType = "fake";
  using Action = LaterAction;
  using Observation = FakeObservation;
};

TEST_F(BadInput, fault_72_OtherFieldsOfTheSameRobotAreNamed) {
  const test::NamedRobot robot;
  EXPECT_THAT(message_of<IncompatibleSession>([] { return connect<LaterFakeRobot>("robot"); }),
              AllOf(HasSubstr("the action"), HasSubstr("gain float64"), HasSubstr("same version")));
}

TEST_F(BadInput, fault_30_CompanionsAreFoundByNameAndType) {
  const test::NamedRobot robot;
  const auto user = observe<FakeRobot>("robot");
  EXPECT_THAT(message_of<SessionNotFound>([&] { return user.companion("camera"); }),
              AllOf(HasSubstr("'robot'"), HasSubstr("'camera'")));
  EXPECT_THAT(message_of<IncompatibleSession>(
                  [&] { return Companion<test::OddLampReading>(user.companion("sensor")); }),
              HasSubstr("colour uint16[3]"));
  EXPECT_THAT(message_of<InvalidArgument>([&] {
                return user.companion("sensor").session().element(Series::kDesiredAction);
              }),
              HasSubstr("no series 'desired_action'"));
  FakeObservation element;
  const UntypedFrontend robot_itself("robot", {.control = false});
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { return robot_itself.get_latest_at(0, &element, kForever); }),
              HasSubstr("get_observation"));
}

TEST_F(BadInput, ObserversDoNotControl) {
  const test::NamedRobot robot;
  auto observer = observe<FakeRobot>("robot");
  EXPECT_THAT(message_of<InvalidArgument>([&] { return observer.append_desired_action({}); }),
              AllOf(HasSubstr("only observes"), HasSubstr("connect()")));
  EXPECT_THROW(observer.finish(), InvalidArgument);
}

TEST_F(BadInput, fault_19_ASecondControllerLearnsWhoIsTheFirst) {
  const test::NamedRobot robot;
  const auto first = connect<FakeRobot>("robot");
  EXPECT_THAT(message_of<ControlHeld>([] { return connect<FakeRobot>("robot"); }),
              AllOf(HasSubstr("another handle in this process"), HasSubstr("observe()")));
  // Observing is always possible.
  static_cast<void>(observe<FakeRobot>("robot").latest_observation());
}

TEST(BadInputAcrossProcesses, fault_19_ASecondControllerLearnsWhichProcessIsTheFirst) {
  test::AcrossProcesses::Rig<test::FakeDriverTraits> rig;
  const test::SharedValue<std::atomic<bool>> connected;
  test::ChildProcess first([&] {
    const auto robot = rig.connect();
    connected->store(true);
    while (true) ::pause();
    return 0;
  });
  while (!connected->load()) std::this_thread::yield();
  EXPECT_THAT(message_of<ControlHeld>([&] { return rig.connect(); }),
              HasSubstr("(process " + std::to_string(first.pid()) + ")"));
  EXPECT_EQ(rig.observe().session().info().controller.pid, first.pid());
}

TEST(BadInputAcrossProcesses, ADeadBackendIsNoticedByThoseWhoWait) {
  test::AcrossProcesses::Rig<test::FakeDriverTraits> rig;
  auto robot = rig.connect();
  const auto observer = rig.observe();
  test::run_steps<test::FakeDriverTraits>(robot, 0, 9);
  robot.wait_until_time_index(10);
  rig.kill();
  for (const Frontend<FakeRobot>* const handle : {&std::as_const(robot), &observer}) {
    const auto fault = test::fault_of([&] { return handle->get_observation(11); });
    EXPECT_EQ(fault.value_or(Fault{}).code, Fault::Code::kBackendDied);
    EXPECT_EQ(handle->fault(), fault);
    // Existing elements can still be read.
    static_cast<void>(handle->get_observation(10));
    static_cast<void>(handle->get_status(9));
  }
  EXPECT_EQ(test::code_of([&] { robot.finish(); }), Fault::Code::kBackendDied);
  EXPECT_EQ(test::code_of([&] { robot.recover(); }), Fault::Code::kBackendDied);
  EXPECT_THAT(message_of<SessionNotFound>([] { return connect<FakeRobot>("robot"); }),
              AllOf(HasSubstr("is gone"), HasSubstr(std::to_string(rig.process().pid()))));
  const SessionInfo info = Session::open("robot").info();
  EXPECT_FALSE(info.backend_is_alive);
  EXPECT_EQ(info.fault.code, Fault::Code::kBackendDied);
  EXPECT_EQ(info.steps, 10);
}

TEST(BadInputAcrossProcesses, AFullQueueDoesNotOutliveItsBackend) {
  test::AcrossProcesses::Rig<test::FakeDriverTraits> rig(test::with_deadlines());
  auto robot = rig.connect();
  rig.tick();
  rig.kill();
  const auto fault = test::fault_of([&] {
    for (int i = 0; i < 1000; ++i) robot.append_desired_action({});
    return 0;
  });
  EXPECT_EQ(fault.value_or(Fault{}).code, Fault::Code::kBackendDied);
}

TEST(BadInputAcrossProcesses, fault_02_AControllerThatIsKilledLeavesTheRobotToTheNext) {
  test::AcrossProcesses::Rig<test::FakeDriverTraits> rig;
  test::ChildProcess controller([&] {
    auto robot = rig.connect();
    for (TimeIndex t = 0; t < 5; ++t)
      robot.append_desired_action(test::FakeDriverTraits::action(t));
    while (true) ::pause();
    return 0;
  });
  const auto observer = rig.observe();
  observer.wait_until_time_index(5);
  controller.kill();
  test::expect_end(observer, 5, {.code = Fault::Code::kControllerDied});
  auto next = rig.connect();
  test::run_steps<test::FakeDriverTraits>(next, 0, 3);
}

TEST(BadInputAcrossProcesses, fault_02_AControllerThatIsKilledBeforeItActsLeavesNoTrace) {
  test::AcrossProcesses::Rig<test::FakeDriverTraits> rig;
  const test::SharedValue<std::atomic<bool>> connected;
  test::ChildProcess controller([&] {
    const auto robot = rig.connect();
    connected->store(true);
    while (true) ::pause();
    return 0;
  });
  while (!connected->load()) std::this_thread::yield();
  const auto id = rig.observe().session().info().session_id;
  controller.kill();
  auto next = rig.connect();
  EXPECT_EQ(next.session().info().session_id, id);
  test::run_steps<test::FakeDriverTraits>(next, 0, 9);
  next.finish();
  test::expect_end(next, 10, {.code = Fault::Code::kFinished});
}

TEST(BadInputAcrossProcesses, fault_64_AHandleThatWentThroughAForkIsRefusedAndHarmless) {
  test::AcrossProcesses::Rig<test::FakeDriverTraits> rig;
  auto robot = rig.connect();
  test::run_steps<test::FakeDriverTraits>(robot, 0, 3);
  const UntypedFrontend companion = robot.companion("sensor");
  test::ChildProcess child([&] {
    FakeSensorReading reading;
    const std::vector<std::function<void()>> calls{
        [&] { robot.append_desired_action({}); },
        [&] { static_cast<void>(robot.get_observation(0)); },
        [&] { static_cast<void>(robot.get_status(0)); },
        [&] { static_cast<void>(robot.latest_observation()); },
        [&] { robot.wait_until_time_index(0); },
        [&] { static_cast<void>(robot.current_time_index()); },
        [&] { static_cast<void>(robot.fault()); },
        [&] { static_cast<void>(robot.companion("sensor")); },
        [&] { static_cast<void>(companion.get_latest_at(0, &reading, kForever)); },
        [&] { robot.finish(); },
        [&] { robot.recover(); },
    };
    for (std::size_t i = 0; i < calls.size(); ++i) {
      if (message_of<InheritedHandle>([&] {
            calls[i]();
            return 0;
          }).find("fork()") == std::string::npos) {
        return static_cast<int>(10 + i);
      }
    }
    // Destroying the inherited handle must not release the robot.
    {
      const auto inherited = std::move(robot);
    }
    // The child may have its own handle.
    static_cast<void>(observe<FakeRobot>("robot").get_observation(0));
    return 0;
  });
  EXPECT_EQ(child.wait(), 0);
  test::run_steps<test::FakeDriverTraits>(robot, 4, 9);
  EXPECT_FALSE(robot.fault().has_value());
}

TEST_F(BadInput, fault_64_ABackendThatWentThroughAForkIsHarmless) {
  FakeDriver driver;
  SessionHost host = SessionHost::named("robot");
  auto backend = std::make_unique<Backend>(driver, host);
  Frontend<FakeRobot> robot(*backend);
  robot.append_desired_action({.setpoint = 1.0});
  std::optional<SessionHost> inherited(std::move(host));
  test::ChildProcess child([&] {
    backend.reset();
    inherited.reset();
    return 0;
  });
  EXPECT_EQ(child.wait(), 0);
  static_cast<void>(robot.get_observation(1));
  EXPECT_TRUE(Session::open("robot").info().backend_is_alive);
}

TEST(BadInputAcrossProcesses, fault_18_ASecondBackendLearnsWhoOwnsTheRobot) {
  test::AcrossProcesses::Rig<test::FakeDriverTraits> rig;
  static_cast<void>(rig.observe());
  EXPECT_THAT(
      message_of<RobotOwned>([] { return SessionHost::named("robot"); }),
      AllOf(HasSubstr("'robot'"), HasSubstr("process " + std::to_string(rig.process().pid())),
            HasSubstr("trifinger stop")));
}

TEST(BadInputAcrossProcesses, fault_18_TheNameOfADeadBackendIsFreeAtOnce) {
  test::AcrossProcesses::Rig<test::FakeDriverTraits> rig;
  std::optional<Frontend<FakeRobot>> old(rig.connect());
  test::run_steps<test::FakeDriverTraits>(*old, 0, 5);
  rig.kill();
  const test::NamedRobot next;
  auto robot = connect<FakeRobot>("robot");
  test::run_steps<test::FakeDriverTraits>(robot, 0, 5);
  // The old handle knows that its session is over, although another back-end has the name.
  EXPECT_EQ(test::code_of([&] { return old->get_status(1000); }), Fault::Code::kBackendDied);
  old.reset();
  test::run_steps<test::FakeDriverTraits>(robot, 6, 9);
  std::size_t action_files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(session_folder())) {
    if (entry.path().extension() == ".action") ++action_files;
  }
  EXPECT_EQ(action_files, 1U) << "what the dead left behind is removed";
}

TEST_F(BadInput, WrongOptionsOfABackendAreNamed) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  const auto message = [&](const BackendOptions& options) {
    return message_of<InvalidArgument>([&] {
      const Backend backend(driver, host, options);
      return 0;
    });
  };
  EXPECT_THAT(message({.period = Nanoseconds::zero()}), HasSubstr("period"));
  EXPECT_THAT(message({.period = Nanoseconds(-1)}), HasSubstr("period"));
  EXPECT_THAT(message({.first_action_timeout = Nanoseconds::zero()}),
              HasSubstr("first_action_timeout"));
  EXPECT_THAT(message({.driver_timeout = Nanoseconds::zero()}), HasSubstr("driver_timeout"));
  EXPECT_THAT(message({.max_stop_time = Nanoseconds(-1)}), HasSubstr("max_stop_time"));
  EXPECT_THAT(message({.late_after = Nanoseconds(-1)}), HasSubstr("late_after"));
  EXPECT_THAT(message({.max_measurement_age = Nanoseconds(-1)}), HasSubstr("max_measurement_age"));
}

TEST_F(BadInput, RealTimeCannotRunInline) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host, {.mode = BackendOptions::Mode::kRealTime});
  EXPECT_THAT(message_of<InvalidArgument>([&] { return Frontend<FakeRobot>(backend); }),
              HasSubstr("inline"));
}

TEST_F(BadInput, AnImpossibleHistoryIsRefused) {
  FakeDriver driver;
  for (const SessionOptions& options : {SessionOptions{.history = std::size_t{1} << 40U},
                                        SessionOptions{.queue = std::size_t{1} << 40U}}) {
    SessionHost host = SessionHost::anonymous(options);
    Backend backend(driver, host);
    EXPECT_THROW(backend.begin_session(), InvalidArgument);
  }
}

// --- Damaged state files
// ----------------------------------------------------------------------------------

// A copy of a living session, to be damaged.
class TamperedSession : public BadInput {
 protected:
  TamperedSession() {
    auto user = connect<FakeRobot>("robot");
    for (TimeIndex t = 0; t < 10; ++t) user.append_desired_action({.setpoint = 1.0});
    user.finish();
    // A further session, so that control is available.
    auto next = connect<FakeRobot>("robot");
    static_cast<void>(next.latest_observation());
    state_ = read_file(path("robot.state"));
    sensor_ = read_file(path("robot.sensor.state"));
  }

  [[nodiscard]] std::filesystem::path path(const std::string& file) const {
    return folder_.path() / ("trifinger." + file);
  }
  // Returns the message of IncompatibleSession from opening the copy; "nothing" if it can be
  // opened.
  [[nodiscard]] std::string message_of_copy() const {
    write_file(path("copy.state"), copy_);
    return message_of<IncompatibleSession>([] { return Session::open("copy"); });
  }
  [[nodiscard]] detail::StateHeader& header() {
    return *reinterpret_cast<detail::StateHeader*>(copy_.data());
  }

  test::NamedRobot robot_;
  Bytes state_;
  Bytes sensor_;
  Bytes copy_;
};

TEST_F(TamperedSession, ReadsAnUntouchedCopy) {
  for (const Bytes& original : {state_, sensor_}) {
    copy_ = original;
    EXPECT_EQ(message_of_copy(), "nothing");
  }
}

// Tries every way in, of every kind of user, to a session of every other version.
TEST_F(TamperedSession, fault_30_EveryWayInSaysWhichVersionWasFoundAndWhichIsRead) {
  const std::vector<std::pair<std::string, std::function<void()>>> ways{
      {"open", [] { static_cast<void>(Session::open("copy")); }},
      {"connect", [] { static_cast<void>(connect<FakeRobot>("copy")); }},
      {"observe", [] { static_cast<void>(observe<FakeRobot>("copy")); }},
      {"recover", [] { recover("copy", Timeout::zero()); }},
  };
  for (const Bytes& original : {state_, sensor_}) {
    for (const std::uint32_t version :
         {0U, detail::kLayoutVersion - 1, detail::kLayoutVersion + 1, 77U, ~0U}) {
      copy_ = original;
      header().layout_version = version;
      write_file(path("copy.state"), copy_);
      for (const auto& [name, way] : ways) {
        EXPECT_THAT(message_of<IncompatibleSession>([&way = way] {
                      way();
                      return 0;
                    }),
                    AllOf(HasSubstr("'copy'"), HasSubstr("is version " + std::to_string(version)),
                          HasSubstr("reads version " + std::to_string(detail::kLayoutVersion)),
                          HasSubstr("install the same version")))
            << name;
      }
      // The incompatible session neither hides the others nor occupies its name.
      EXPECT_EQ(list_sessions().size(), 2U);
    }
  }
  static_cast<void>(SessionHost::named("copy"));
}

TEST_F(TamperedSession, RefusesWhatIsNoSessionFile) {
  copy_ = state_;
  header().magic = 1;
  EXPECT_THAT(message_of_copy(), HasSubstr("not a session file"));
  copy_ = Bytes();
  EXPECT_THAT(message_of_copy(), HasSubstr("not a session file"));
  copy_ = Bytes(100, 'x');
  EXPECT_THAT(message_of_copy(), HasSubstr("not a session file"));
}

TEST_F(TamperedSession, fault_72_RefusesFieldsThatDoNotFitTheirHash) {
  copy_ = state_;
  ++header().description_hash;
  EXPECT_THAT(message_of_copy(), HasSubstr("hash"));
  copy_ = state_;
  copy_[header().descriptions[0].offset] = 'S';  // "Setpoint"
  EXPECT_THAT(message_of_copy(), HasSubstr("hash"));
}

TEST_F(TamperedSession, RefusesAFileThatWasCutOff) {
  std::mt19937 random(1);
  for (const Bytes& original : {state_, sensor_}) {
    for (int i = 0; i < 50; ++i) {
      copy_ = original;
      copy_.resize(1 + random() % (original.size() - 1));
      EXPECT_NE(message_of_copy(), "nothing");
    }
  }
}

// Tries everything that can be done with the session `name`. Errors are fine. Crashes and hangs are
// not.
void use(const std::string& name) {
  std::vector<std::uint64_t> element(4096);
  const auto attempt = [](const auto& call) {
    try {
      call();
    } catch (const Error&) {
    }
  };
  attempt([&] { static_cast<void>(Session::open(name).info()); });
  attempt([&] { static_cast<void>(Session::open(name).documents()); });
  attempt([&] {
    const Session session = Session::open(name);
    for (const std::string& companion : session.companion_names()) {
      static_cast<void>(session.companion(companion));
    }
  });
  attempt([&] {
    const UntypedFrontend reader(name, {.control = false});
    for (const Series series :
         {Series::kDesiredAction, Series::kAppliedAction, Series::kObservation, Series::kStatus,
          Series::kHolding, Series::kStopping}) {
      for (const TimeIndex t : {TimeIndex{0}, TimeIndex{7}, TimeIndex{1000}}) {
        attempt([&] { static_cast<void>(reader.try_get(series, t, element.data())); });
        attempt([&] { reader.get(series, t, element.data(), Timeout::zero()); });
        attempt([&] { reader.get(series, t, 3, element.data(), Timeout::zero()); });
      }
      attempt([&] { static_cast<void>(reader.range(series)); });
      attempt([&] { static_cast<void>(reader.session().element(series).text()); });
    }
    attempt([&] { reader.latest_observation(element.data(), Timeout::zero()); });
    attempt([&] { static_cast<void>(reader.get_latest_at(3, element.data(), Timeout::zero())); });
    attempt([&] { static_cast<void>(reader.current_time_index()); });
    attempt([&] { static_cast<void>(reader.fault()); });
  });
  attempt([&] {
    UntypedFrontend controller(name, {.timeout = Timeout::zero()});
    for (int i = 0; i < 3; ++i) controller.append_desired_action(element.data(), Timeout::zero());
  });
}

TEST_F(TamperedSession, NeverCrashesWhoReadsADamagedHeader) {
  write_file(path("copy.lock"), Bytes(1, 'x'));
  std::filesystem::path action;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    if (entry.path().extension() == ".action") action = entry.path();
  }
  const Bytes action_bytes = read_file(action);

  std::mt19937 random(3);
  for (int i = 0; i < 3000; ++i) {
    copy_ = i % 3 == 0 ? sensor_ : state_;
    const std::uint64_t id = header().session_id;
    const std::size_t changes = 1 + random() % 4;
    for (std::size_t change = 0; change < changes; ++change) {
      // Spare the magic and the version: otherwise the rest would not be examined.
      const std::size_t position = 12 + random() % (sizeof(detail::StateHeader) - 12);
      copy_[position] = static_cast<char>(random() % 2 == 0 ? random() : 0);
    }
    write_file(path("copy.state"), copy_);
    // The copy looks alive, because somebody holds its lock.
    const auto holder = ipc::SharedMemory::open(path("copy.state"), ipc::Access::kReadWrite);
    ASSERT_TRUE(ipc::try_lock(holder.file()));
    if (i % 3 != 0) write_file(path("copy." + std::to_string(id) + ".action"), action_bytes);
    use("copy");
  }
}

TEST_F(TamperedSession, NeverCrashesWhoReadsRandomBytes) {
  write_file(path("copy.lock"), Bytes(1, 'x'));
  std::mt19937 random(4);
  for (int i = 0; i < 300; ++i) {
    copy_ = Bytes(sizeof(detail::StateHeader) + random() % 5000);
    for (char& byte : copy_) byte = static_cast<char>(random());
    header().magic = detail::kStateMagic;
    header().layout_version = detail::kLayoutVersion;
    header().file_size = copy_.size();
    write_file(path("copy.state"), copy_);
    use("copy");
  }
}

}  // namespace
}  // namespace trifinger
