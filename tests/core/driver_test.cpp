// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/driver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <exception>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "core/fault_of.hpp"
#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/allocation_counter.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger {
namespace {

// A driver with the paper's two functions and no others.
class TwoFunctions {
 public:
  explicit TwoFunctions(int fails_after = 1'000'000) : fails_after_(fails_after) {}

  FakeObservation get_latest_observation() {
    return {.setpoint = last_, .applied_actions = count_};
  }
  FakeAction apply_action(const FakeAction& desired) {
    if (count_ == fails_after_) throw std::runtime_error("out of order");
    ++count_;
    last_ = desired.setpoint;
    return desired;
  }

 private:
  int fails_after_;
  std::int64_t count_{0};
  double last_{0.0};
};
static_assert(SimpleDriverOf<TwoFunctions, FakeRobot>);

TEST(SimpleDriver, MakesARobotOfThePapersTwoFunctions) {
  SimpleDriver<FakeRobot, TwoFunctions> driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  for (TimeIndex t = 0; t < 5; ++t) {
    robot.append_desired_action({.setpoint = 10.0 * static_cast<double>(t)});
  }
  EXPECT_EQ(robot.get_observation(5).applied_actions, 5);
  EXPECT_EQ(robot.get_observation(5).setpoint, 40.0);
  EXPECT_EQ(robot.get_applied_action(4).setpoint, 40.0);
}

TEST(SimpleDriver, fault_16_TurnsAnExceptionIntoAFault) {
  SimpleDriver<FakeRobot, TwoFunctions> driver(3);
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  for (TimeIndex t = 0; t < 4; ++t) robot.append_desired_action({});
  test::expect_end(robot, 3, {.code = Fault::Code::kDriver, .detail = 1});
  EXPECT_EQ(test::message_of<RobotStopped>([&] { return robot.append_desired_action({}); }),
            "robot 'anonymous' has stopped: the driver gave up at step 3: apply_action threw an "
            "exception: out of order");
}

void throw_no_exception() { std::rethrow_exception(std::make_exception_ptr(3)); }

// A driver whose functions are set by the test.
struct Functions {
  static void return_normally() {}

  std::function<void()> on_observation{return_normally};
  std::function<void()> on_action{return_normally};
  std::function<void()> on_hold{return_normally};
};
class CallingDriver {
 public:
  explicit CallingDriver(Functions functions) : functions_(std::move(functions)) {}

  [[nodiscard]] FakeObservation get_latest_observation() const {
    functions_.on_observation();
    return {};
  }
  FakeAction apply_action(const FakeAction& desired) {
    applied_.push_back(desired.setpoint);
    functions_.on_action();
    return desired;
  }
  [[nodiscard]] FakeAction hold(const FakeObservation&) const {
    functions_.on_hold();
    return {.setpoint = 7.0};
  }

  [[nodiscard]] const std::vector<double>& applied() const noexcept { return applied_; }

 private:
  Functions functions_;
  std::vector<double> applied_;
};

// How a session at 1 kHz ended that only held, and what its robot received.
struct HeldEnd {
  SessionInfo info;
  std::vector<double> applied;
};
HeldEnd end_of_holding(const Functions& functions) {
  SimpleDriver<FakeRobot, CallingDriver> driver(functions);
  SessionHost host = SessionHost::anonymous({.history = 64, .queue = 64});
  HeldEnd end;
  {
    Backend backend(driver, host, {.mode = BackendOptions::Mode::kRealTime});
    backend.set_after_session([&](const Fault&) {
      end.info = host.open().info();
      backend.request_stop();
    });
    backend.run();
  }
  end.applied = driver.get().applied();
  return end;
}

TEST(SimpleDriver, fault_16_WhoseHoldThrowsEndsTheSessionBeforeStep0) {
  const auto [info, applied] =
      end_of_holding({.on_hold = [] { throw std::runtime_error("no encoder answers"); }});
  EXPECT_EQ(info.fault, (Fault{.code = Fault::Code::kDriver, .detail = 1, .time_index = -1}));
  EXPECT_EQ(info.fault_text,
            "the driver gave up before step 0: hold threw an exception: no encoder answers");
  EXPECT_THAT(applied, ::testing::ElementsAre(0.0)) << "Action{}, not what hold may have begun";
}

TEST(SimpleDriver, fault_16_KeepsTheTextOfTheFirstOfTwoExceptions) {
  const auto end = end_of_holding({.on_action = [] { throw std::runtime_error("second"); },
                                   .on_hold = [] { throw std::runtime_error("first"); }});
  EXPECT_THAT(end.info.fault_text, ::testing::HasSubstr("hold threw an exception: first"));
  EXPECT_THAT(end.applied, ::testing::ElementsAre(0.0));
}

TEST(SimpleDriver, fault_16_SaysWhichFunctionThrewAndWhat) {
  const auto text_of = [](const Functions& functions) {
    return end_of_holding(functions).info.fault_text;
  };
  EXPECT_EQ(text_of({.on_observation = [] { throw std::runtime_error("bus is off"); }}),
            "the driver gave up before step 0: get_latest_observation threw an exception: bus is "
            "off");
  EXPECT_EQ(text_of({.on_action = throw_no_exception}),
            "the driver gave up before step 0: apply_action threw an object that is no "
            "std::exception, so there is no text");
  EXPECT_EQ(text_of({.on_hold = [] { throw std::runtime_error("two\nlines, \xff"); }}),
            "the driver gave up before step 0: hold threw an exception: two lines, ?");
  const std::string text =
      text_of({.on_hold = [] { throw std::runtime_error(std::string(1000, 'x')); }});
  EXPECT_THAT(text, ::testing::EndsWith("xxx..."));
}

TEST(SimpleDriver, fault_16_TakesNoMemoryForTheTextOfAnException) {
  const std::exception_ptr error = std::make_exception_ptr(
      std::runtime_error("a text that is too long for the short strings of C++"));
  SimpleDriver<FakeRobot, CallingDriver> driver(
      Functions{.on_observation = [&] { std::rethrow_exception(error); }});
  FakeObservation observation;
  const test::AllocationCounter allocations;
  EXPECT_EQ(driver.get_latest_observation(observation).state, DriverReport::State::kFault);
  EXPECT_FALSE(driver.fault_text(1).empty());
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(SimpleDriver, fault_63_ThatIsInterruptedEndsTheSessionWithoutAFault) {
  const auto [info, applied] = end_of_holding({.on_hold = [] { throw Interrupted("Ctrl-C"); }});
  EXPECT_EQ(info.fault, (Fault{.code = Fault::Code::kDetached, .time_index = -1}));
  EXPECT_THAT(applied, ::testing::ElementsAre(0.0));

  SimpleDriver<FakeRobot, CallingDriver> driver(
      Functions{.on_action = [] { throw Interrupted("Ctrl-C"); }});
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  robot.append_desired_action({});
  test::expect_end(robot, 0, {.code = Fault::Code::kDetached});
  Frontend<FakeRobot> next(backend);
  EXPECT_FALSE(next.fault());
}

// What a user sees of the fault from outside.
TEST(Driver, fault_16_ShowsItsTextToObserversAndToWhoConnectsLater) {
  const test::SessionFolder folder;
  SimpleDriver<FakeRobot, TwoFunctions> driver(3);
  SessionHost host = SessionHost::named("robot");
  Backend backend(driver, host);
  const BackendThread thread(backend);
  Frontend<FakeRobot> robot(host);
  for (TimeIndex t = 0; t < 4; ++t) robot.append_desired_action({});
  const std::string text =
      "the driver gave up at step 3: apply_action threw an exception: out of order";
  EXPECT_EQ(test::message_of<RobotStopped>([&] { (void)robot.get_status(10); }),
            "robot 'robot' has stopped: " + text);
  EXPECT_EQ(Session::open("robot").info().fault_text, text);
  EXPECT_THAT(test::message_of<RobotStopped>([&] { (void)connect<FakeRobot>("robot"); }),
              ::testing::HasSubstr(text));
}

TEST(Driver, fault_06_SaysWhatWasNotFitInTheLastActionItRejected) {
  FakeDriver driver({.rejected_setpoint = 1.0});
  SessionHost host = SessionHost::anonymous({}, "left");
  Backend backend(driver, host, {.max_rejected_actions = 1});
  const std::string text =
      "robot 'left' has stopped: 2 actions in a row up to step 2 were not fit to apply; the last: "
      "its setpoint is the one that this fake robot was told to reject";
  {
    Frontend<FakeRobot> robot(backend);
    for (int i = 0; i < 3; ++i) robot.append_desired_action({.setpoint = 1.0});
    EXPECT_EQ(test::message_of<RobotStopped>([&] { (void)robot.get_status(10); }), text);
  }
  EXPECT_EQ(test::message_of<RobotStopped>([&] { (void)Frontend<FakeRobot>(backend); }),
            text + "; clear this with recover() when it is safe");
}

TEST(Control, fault_19_ComesBackFromAFrontEndThatIsClosedWhateverElseIsKept) {
  const auto expect_free = [](const auto& connect) {
    auto robot = std::make_optional(connect());
    robot->append_desired_action({});
    static_cast<void>(robot->get_status(0));
    // Handles of other kinds for this session.
    const UntypedFrontend companion = robot->companion("sensor");
    const Session session = robot->session();
    const Session companion_session = session.companion("sensor");
    const Frontend<FakeRobot> looker(session);
    robot.reset();
    // The next session counts its own steps.
    Frontend<FakeRobot> next = connect();
    EXPECT_EQ(next.append_desired_action({}), 0);
    EXPECT_NE(next.session().info().session_id, session.info().session_id);
    EXPECT_EQ(session.info().fault.code, Fault::Code::kDetached);
    FakeSensorReading reading;
    EXPECT_TRUE(companion.get_latest_at(0, &reading, test::kLong));
    EXPECT_EQ(looker.get_observation(0).applied_actions, 0);
    EXPECT_EQ(companion_session.info().fault.code, Fault::Code::kDetached);
  };
  {
    FakeDriver driver({.sensor_period = 1});
    SessionHost host = SessionHost::anonymous();
    Backend backend(driver, host);
    expect_free([&] { return Frontend<FakeRobot>(backend); });
  }
  const test::SessionFolder folder;
  FakeDriver driver({.sensor_period = 1});
  SessionHost host = SessionHost::named("robot");
  Backend backend(driver, host);
  const BackendThread thread(backend);
  expect_free([&] { return Frontend<FakeRobot>(host, {.timeout = test::kLong}); });
}

// The fake robot's own injections, which tests of users need.
TEST(FakeDriver, FaultsAndRejectsWhereItIsTold) {
  const auto end_with = [](const FakeDriver::Options& options) {
    FakeDriver driver(options);
    SessionHost host = SessionHost::anonymous();
    Backend backend(driver, host, {.max_rejected_actions = 1});
    Frontend<FakeRobot> robot(backend);
    for (TimeIndex t = 0; t < 10; ++t) {
      robot.append_desired_action({.setpoint = t < 5 ? 0.0 : 1.0});
    }
    return test::fault_of([&] { return robot.get_status(100); }).value_or(Fault{});
  };
  EXPECT_EQ(
      end_with({.observation_fault_after = 4}),
      (Fault{.code = Fault::Code::kDriver, .detail = FakeDriver::kInjectedFault, .time_index = 4}));
  EXPECT_EQ(
      end_with({.action_fault_after = 6}),
      (Fault{.code = Fault::Code::kDriver, .detail = FakeDriver::kInjectedFault, .time_index = 6}));
  EXPECT_EQ(end_with({.rejected_setpoint = 1.0}),
            (Fault{.code = Fault::Code::kActionsRejected, .detail = 2, .time_index = 7}));
}

TEST(FakeDriver, HasASensorWithARateAndADelay) {
  FakeDriver driver({.sensor_period = 4, .sensor_delay = 2});
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  Frontend<FakeRobot> robot(backend);
  const Companion<FakeSensorReading> sensor(robot.companion("sensor"));
  for (TimeIndex t = 0; t < 20; ++t) robot.append_desired_action({});
  EXPECT_FALSE(sensor.get_latest_at(1).has_value());
  for (TimeIndex t = 2; t < 20; ++t) {
    const auto reading = sensor.get_latest_at(t);
    ASSERT_TRUE(reading.has_value());
    const TimeIndex captured = (t - 2) / 4 * 4;
    EXPECT_EQ(reading->stamp.capture_index, captured);
    EXPECT_EQ(reading->stamp.arrival_index, captured + 2);
    EXPECT_EQ(reading->applied_actions, captured);
  }
}

}  // namespace
}  // namespace trifinger
