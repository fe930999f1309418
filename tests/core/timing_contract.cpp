// SPDX-License-Identifier: BSD-3-Clause
#include "core/timing_contract.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <functional>
#include <optional>
#include <thread>

#include "core/fault_of.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::test {
namespace {

// The traits of a driver in the form that AnyUser has: an action is its number.
struct Numbers {
  static TimeIndex action(TimeIndex k) { return k; }
};

// The law of the end if no step had begun: there is no step 0, and there never will be.
// Observations from the time of holding remain.
void expect_end_before_step_zero(const AnyUser& robot, const Fault& expected,
                                 bool has_observation = true) {
  // Waits for the end.
  EXPECT_EQ(fault_of([&] { return robot.get_status(0); }), expected);
  EXPECT_EQ(robot.fault(), expected);
  EXPECT_EQ(robot.current_time_index(), -1);
  // The answer stays the same for ever.
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(fault_of([&] { return robot.get_observation(0); }), expected);
    EXPECT_EQ(fault_of([&] { return robot.get_desired_action(0); }), expected);
    EXPECT_EQ(fault_of([&] { return robot.get_applied_action(0); }), expected);
    EXPECT_EQ(fault_of([&] { return robot.get_status(0); }), expected);
    EXPECT_EQ(fault_of([&] {
                robot.wait_until_time_index(0);
                return 0;
              }),
              expected);
    const auto latest = fault_of([&] { return robot.latest_observation(); });
    EXPECT_EQ(latest, has_observation ? std::nullopt : std::optional(expected));
  }
}

// The actions that the user sent are there, in order.
void expect_actions(const AnyUser& robot, TimeIndex steps) {
  for (TimeIndex t = 0; t < steps; ++t) {
    ASSERT_EQ(robot.get_desired_action(t), robot.action(t)) << t;
  }
}

// In every step, the observation is measured before the action of that step acts.
void expect_measured_before_acting(const CallLog& log) {
  const std::int64_t count = std::min<std::int64_t>(log.observations, CallLog::kSize);
  for (std::int64_t i = 0; i < count; ++i) {
    ASSERT_EQ(log.actions_before_observation[static_cast<std::size_t>(i)], i);
  }
}

// --- Without deadlines ---

TEST_P(TimingContract, NamesTheStepsOfActionsOneByOne) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  for (TimeIndex t = 0; t < 20; ++t) {
    EXPECT_EQ(robot->append_desired_action(t), t);
  }
}

TEST_P(TimingContract, ShowsTheRobotBeforeStepZero) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  const auto holding = robot->latest_observation();
  EXPECT_EQ(robot->current_time_index(), -1);
  robot->append_desired_action(0);
  // Nothing has moved in between.
  EXPECT_EQ(robot->get_observation(0), holding);
}

TEST_P(TimingContract, MeasuresBeforeTheActionOfTheStepActs) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  run_steps<Numbers>(*robot, 0, 50);
  robot->finish();
  expect_measured_before_acting(rig->log());
}

TEST_P(TimingContract, ObservationDoesNotDependOnTheActionOfItsStep) {
  constexpr TimeIndex kChanged = 7;
  std::vector<Bytes> observations[2];
  for (int run = 0; run < 2; ++run) {
    const auto rig = make_rig();
    const auto robot = rig->connect();
    for (TimeIndex t = 0; t <= 10; ++t) {
      robot->append_desired_action(run == 1 && t >= kChanged ? 100 + t : t);
    }
    for (TimeIndex t = 0; t <= 10; ++t) observations[run].push_back(robot->get_observation(t));
    robot->finish();
  }
  for (std::size_t t = 0; t <= kChanged; ++t)
    EXPECT_EQ(observations[0][t], observations[1][t]) << t;
  EXPECT_NE(observations[0].back(), observations[1].back()) << "the driver answers to no action";
}

TEST_P(TimingContract, ShowsTheNextObservationBeforeItsAction) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  robot->append_desired_action(0);
  static_cast<void>(robot->get_observation(1));
  EXPECT_EQ(robot->current_time_index(), 1);
}

TEST_P(TimingContract, fault_62_WaitsForAnActionAsLongAsItTakes) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  run_steps<Numbers>(*robot, 0, 3);
  robot->wait_until_time_index(4);
  // Days pass on the back-end's clock.
  rig->clock().advance(std::chrono::hours(100));
  EXPECT_EQ(robot->current_time_index(), 4);
  EXPECT_FALSE(robot->fault().has_value());
  robot->append_desired_action(4);
  robot->wait_until_time_index(5);
  robot->finish();
  expect_end(*robot, 5, {.code = Fault::Code::kFinished});
}

TEST_P(TimingContract, MarksAnActionThatCameAfterItsObservation) {
  const auto rig = make_rig();
  const auto robot = rig->connect({.strict = false});
  robot->append_desired_action(0);
  static_cast<void>(robot->get_observation(1));
  EXPECT_EQ(robot->append_desired_action(1), 1);
  EXPECT_EQ(robot->append_desired_action(2), 2);
  EXPECT_FALSE(has_flag(*robot, 0, Status::kAcausal));
  EXPECT_TRUE(has_flag(*robot, 1, Status::kAcausal));
  EXPECT_FALSE(has_flag(*robot, 2, Status::kAcausal));
}

TEST_P(TimingContract, RefusesAnActionThatCameAfterItsObservationIfStrict) {
  const auto rig = make_rig();
  const auto robot = rig->connect({.strict = true});
  robot->append_desired_action(0);
  static_cast<void>(robot->get_observation(1));
  EXPECT_THROW(robot->append_desired_action(1), AcausalAction);
  // The rule also holds if many were read at once, or the latest.
  EXPECT_THROW(robot->append_desired_action(1), AcausalAction);
}

TEST_P(TimingContract, CountsEveryWayToReadAsKnowing) {
  const std::vector<std::function<void(const AnyUser&)>> ways{
      [](const AnyUser& robot) { static_cast<void>(robot.get_observation(1)); },
      [](const AnyUser& robot) { static_cast<void>(robot.get_observations(0, 2)); },
      [](const AnyUser& robot) {
        robot.wait_until_time_index(1);
        static_cast<void>(robot.latest_observation());
      }};
  for (const auto& read : ways) {
    const auto rig = make_rig();
    const auto robot = rig->connect({.strict = true});
    robot->append_desired_action(0);
    read(*robot);
    EXPECT_THROW(robot->append_desired_action(1), AcausalAction);
  }
}

TEST_P(TimingContract, TakesABurst) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  EXPECT_EQ(robot->append_desired_actions(0, 29), 29);
  EXPECT_EQ(robot->append_desired_action(30), 30);
  robot->finish();
  expect_end(*robot, 31, {.code = Fault::Code::kFinished});
  expect_actions(*robot, 31);
}

TEST_P(TimingContract, ReadsManyStepsInOneCall) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  run_steps<Numbers>(*robot, 0, 19);
  const auto observations = robot->get_observations(4, 15);
  const auto desired = robot->get_desired_actions(4, 15);
  const auto applied = robot->get_applied_actions(4, 15);
  const auto statuses = robot->get_statuses(4, 15);
  for (std::size_t i = 0; i < 15; ++i) {
    const TimeIndex t = 4 + static_cast<TimeIndex>(i);
    EXPECT_EQ(observations[i], robot->get_observation(t));
    EXPECT_EQ(desired[i], robot->get_desired_action(t));
    EXPECT_EQ(applied[i], robot->get_applied_action(t));
    EXPECT_EQ(statuses[i].tick, t);
  }
  EXPECT_TRUE(robot->get_observations(4, 0).empty());
}

TEST_P(TimingContract, RefusesARangeThatTheHistoryCannotHold) {
  const auto rig = make_rig({.session = {.history = 16}});
  const auto robot = rig->connect();
  EXPECT_THROW(static_cast<void>(robot->get_observations(0, 17)), InvalidArgument);
  EXPECT_THROW(static_cast<void>(robot->get_observation(-1)), InvalidArgument);
}

TEST_P(TimingContract, fault_34_NamesTheOldestStepWhenHistoryIsLost) {
  const auto rig = make_rig({.session = {.history = 16, .queue = 16}});
  const auto robot = rig->connect();
  run_steps<Numbers>(*robot, 0, 40);
  // y_41 exists, so 26 to 41 are kept.
  robot->wait_until_time_index(41);
  try {
    static_cast<void>(robot->get_observation(3));
    ADD_FAILURE() << "step 3 was kept";
  } catch (const HistoryLost& lost) {
    EXPECT_EQ(lost.oldest(), 26);
  }
  EXPECT_THROW(static_cast<void>(robot->get_observation(25)), HistoryLost);
  static_cast<void>(robot->get_observation(26));
  EXPECT_THROW(static_cast<void>(robot->get_observations(24, 4)), HistoryLost);
  static_cast<void>(robot->get_observations(26, 4));
}

TEST_P(TimingContract, fault_05_AppendWaitsWhileTheQueueIsFull) {
  const auto rig = make_rig({.session = {.history = 256, .queue = 4}});
  const auto robot = rig->connect();
  // Nothing is lost and everything is in order, although the queue is much too short.
  for (TimeIndex t = 0; t < 100; ++t) {
    EXPECT_EQ(robot->append_desired_action(t), t);
  }
  robot->finish();
  expect_end(*robot, 100, {.code = Fault::Code::kFinished});
  expect_actions(*robot, 100);
}

TEST_P(TimingContract, EndsAfterTheLastActionWhenFinished) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  run_steps<Numbers>(*robot, 0, 9);
  robot->finish();
  expect_end(*robot, 10, {.code = Fault::Code::kFinished});
  expect_actions(*robot, 10);
  EXPECT_TRUE(fault_of([&] { return robot->append_desired_action(0); }));
  // Calling it again is no fault.
  robot->finish();
}

TEST_P(TimingContract, EndsWhenFinishedBeforeAnyAction) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  static_cast<void>(robot->latest_observation());
  robot->finish();
  expect_end(*robot, 0, {.code = Fault::Code::kFinished});
}

TEST_P(TimingContract, EndsWhenTheControllerLetsGo) {
  const auto rig = make_rig();
  auto robot = rig->connect();
  const auto observer = rig->observe();
  run_steps<Numbers>(*robot, 0, 9);
  robot->wait_until_time_index(10);
  robot.reset();
  expect_end(*observer, 10, {.code = Fault::Code::kDetached});
}

TEST_P(TimingContract, StaysWhenAControllerWithoutActionsLetsGo) {
  const auto rig = make_rig();
  const auto id = rig->connect()->session().info().session_id;
  const auto second = rig->connect();
  EXPECT_EQ(second->session().info().session_id, id);
  EXPECT_EQ(second->append_desired_action(0), 0);
  static_cast<void>(second->get_observation(0));
}

TEST_P(TimingContract, EndsWhenTheDriverFaultsWhileMeasuring) {
  const auto rig = make_rig({.injection = {.observation_fault_at = 5}});
  const auto robot = rig->connect();
  for (TimeIndex t = 0; t < 5; ++t) robot->append_desired_action(t);
  expect_end(*robot, 5, {.code = Fault::Code::kDriver, .detail = DriverUnderTest::kFaultCode},
             false);
  expect_actions(*robot, 5);
}

TEST_P(TimingContract, EndsWhenTheDriverFaultsWhileApplying) {
  const auto rig = make_rig({.injection = {.action_fault_at = 5}});
  const auto robot = rig->connect();
  for (TimeIndex t = 0; t < 6; ++t) robot->append_desired_action(t);
  expect_end(*robot, 5, {.code = Fault::Code::kDriver, .detail = DriverUnderTest::kFaultCode});
}

TEST_P(TimingContract, fault_06_EndsWhenTooManyActionsInARowAreRejected) {
  const auto rig =
      make_rig({.backend = {.max_rejected_actions = 3}, .injection = {.reject_from = 5}});
  const auto robot = rig->connect();
  // The session may end while the last actions are under way.
  static_cast<void>(fault_of([&] {
    for (TimeIndex t = 0; t < 12; ++t) robot->append_desired_action(t);
    return 0;
  }));
  expect_end(*robot, 9, {.code = Fault::Code::kActionsRejected, .detail = 4});
  for (TimeIndex t = 0; t < 9; ++t) {
    EXPECT_EQ(has_flag(*robot, t, Status::kActionRejected), t >= 5);
    EXPECT_EQ(robot->get_status(t).rejected_actions, t >= 5 ? t - 4 : 0);
  }
}

TEST_P(TimingContract, EndsWhenTheBackendIsAskedToStop) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  run_steps<Numbers>(*robot, 0, 9);
  robot->wait_until_time_index(10);
  rig->request_stop();
  expect_end(*robot, 10, {.code = Fault::Code::kStopped});
}

TEST_P(TimingContract, EndsWhenTheBackendIsAskedToStopBeforeAnyAction) {
  const auto rig = make_rig();
  const auto robot = rig->connect();
  static_cast<void>(robot->latest_observation());
  rig->request_stop();
  expect_end_before_step_zero(*robot, {.code = Fault::Code::kStopped});
}

TEST_P(TimingContract, EndsWhenTheDriverFaultsBeforeAnyAction) {
  const auto rig = make_rig({.injection = {.observation_fault_at = 0}});
  // A user who wants control is refused if the fault comes first.
  const auto observer = rig->observe();
  expect_end_before_step_zero(
      *observer, {.code = Fault::Code::kDriver, .detail = DriverUnderTest::kFaultCode}, false);
}

TEST_P(TimingContract, SaysWhyInTheText) {
  const auto rig = make_rig({.injection = {.action_fault_at = 2}});
  const auto robot = rig->connect();
  for (TimeIndex t = 0; t < 3; ++t) robot->append_desired_action(t);
  try {
    static_cast<void>(robot->get_observation(3));
    ADD_FAILURE() << "the robot did not stop";
  } catch (const RobotStopped& stopped) {
    EXPECT_THAT(stopped.what(), ::testing::HasSubstr("step 2"));
    EXPECT_THAT(stopped.what(), ::testing::HasSubstr("a test injected this"));
  }
}

TEST_P(TimingContract, BeginsTheNextSessionAtOnceAfterACleanEnd) {
  const auto rig = make_rig();
  const auto first = rig->connect();
  run_steps<Numbers>(*first, 0, 4);
  first->finish();
  const auto second = rig->connect();
  EXPECT_NE(second->session().info().session_id, first->session().info().session_id);
  run_steps<Numbers>(*second, 0, 2);
  static_cast<void>(second->get_observation(3));
  // The old handle still shows its own session.
  expect_end(*first, 5, {.code = Fault::Code::kFinished});
}

TEST_P(TimingContract, NeedsRecoveryAfterAFault) {
  const auto rig = make_rig({.injection = {.stop_periods = 3, .action_fault_at = 2}});
  const auto first = rig->connect();
  for (TimeIndex t = 0; t < 3; ++t) first->append_desired_action(t);
  const Fault fault{.code = Fault::Code::kDriver, .detail = DriverUnderTest::kFaultCode};
  expect_end(*first, 2, fault);
  EXPECT_EQ(code_of([&] { return rig->connect(); }), Fault::Code::kDriver);

  first->recover();
  const auto second = rig->connect();
  run_steps<Numbers>(*second, 0, 9);
  second->finish();
  expect_end(*second, 10, {.code = Fault::Code::kFinished});
  expect_end(*first, 2, fault);
}

TEST_P(TimingContract, NeedsRecoveryWhenTheDriverCannotBePrepared) {
  const auto rig = make_rig({.injection = {.prepare_faults = true}});
  const auto stopped = [&] {
    const auto fault = fault_of([&] {
      // A fast user attaches before the fault and gets it here.
      const auto robot = rig->connect();
      return robot->latest_observation();
    });
    return fault.value_or(Fault{});
  };
  EXPECT_EQ(stopped(),
            (Fault{.code = Fault::Code::kDriver, .detail = DriverUnderTest::kFaultCode}));
  EXPECT_EQ(stopped().code, Fault::Code::kDriver);
}

TEST_P(TimingContract, PreparesAndStopsInSmallSteps) {
  const auto rig = make_rig({.injection = {.prepare_periods = 3, .stop_periods = 4}});
  const auto robot = rig->connect();
  run_steps<Numbers>(*robot, 0, 2);
  EXPECT_EQ(rig->log().prepares, 4);
  robot->finish();
  // The actions of the stop are not part of the series.
  expect_end(*robot, 3, {.code = Fault::Code::kFinished});
  // The next session exists only when the robot is at rest.
  static_cast<void>(rig->connect());
  EXPECT_EQ(rig->log().stops, 5);
}

TEST_P(TimingContract, LetsNobodyWaitLongerThanTheyWant) {
  const auto rig = make_rig({.session = {.history = 64, .queue = 4}});
  const auto robot = rig->connect();
  robot->append_desired_action(0);
  robot->wait_until_time_index(1);
  // Inline, a wait that can never end is a mistake, and gets its error at once.
  const auto expect_gives_up = [](const std::function<void()>& call) {
    if (GetParam().is_inline) {
      EXPECT_THROW(call(), ActionMissing);
    } else {
      EXPECT_THROW(call(), TimedOut);
    }
  };
  for (const Timeout timeout : {Timeout::zero(), Timeout(std::chrono::milliseconds(5))}) {
    expect_gives_up([&] { static_cast<void>(robot->get_observation(2, timeout)); });
    expect_gives_up([&] { static_cast<void>(robot->get_desired_action(1, timeout)); });
    expect_gives_up([&] { static_cast<void>(robot->get_applied_action(1, timeout)); });
    expect_gives_up([&] { static_cast<void>(robot->get_status(1, timeout)); });
    expect_gives_up([&] { robot->wait_until_time_index(2, timeout); });
    expect_gives_up([&] { static_cast<void>(robot->get_observations(0, 3, timeout)); });
    expect_gives_up([&] { static_cast<void>(robot->get_statuses(0, 3, timeout)); });
  }
}

TEST_P(TimingContract, HasEverythingOfACompanionThatArrivedByThatStep) {
  const auto driver = GetParam().make_driver();
  if (driver->companions().empty()) GTEST_SKIP() << "no companions";
  const CompanionDescription& description = driver->companions()[0];
  const auto rig = make_rig();
  const auto robot = rig->connect();
  const UntypedFrontend companion = robot->companion(description.name);
  Bytes element(description.element.size());
  const auto arrival_at = [&](TimeIndex t, Timeout timeout) -> std::optional<Stamp> {
    if (!companion.get_latest_at(t, element.data(), timeout)) return std::nullopt;
    Stamp stamp;
    std::memcpy(&stamp, element.data(), sizeof(stamp));
    return stamp;
  };

  std::vector<TimeIndex> known;
  for (TimeIndex t = 0; t < 40; ++t) {
    robot->append_desired_action(t);
    static_cast<void>(robot->get_observation(t));
    // y_t exists, so this needs no wait.
    const auto stamp = arrival_at(t, Timeout::zero());
    known.push_back(stamp ? stamp->arrival_index : -1);
    if (!stamp) continue;
    EXPECT_LE(stamp->arrival_index, t);
    EXPECT_LE(stamp->capture_index, stamp->arrival_index);
    EXPECT_EQ(stamp->arrival_time - stamp->capture_time,
              (stamp->arrival_index - stamp->capture_index) * kPeriod.count());
  }
  EXPECT_TRUE(std::ranges::is_sorted(known));
  EXPECT_GT(known.back(), 0);
  // A later call gives an equal answer.
  for (TimeIndex t = 0; t < 40; ++t) {
    const auto stamp = arrival_at(t, kForever);
    ASSERT_EQ(stamp ? stamp->arrival_index : -1, known[static_cast<std::size_t>(t)]) << t;
  }
  robot->finish();
  EXPECT_EQ(code_of([&] { return arrival_at(1000, kForever); }), Fault::Code::kFinished);
}

TEST_P(TimingContract, GivesTheSameSeriesEveryTime) {
  Bytes series[2];
  for (auto& bytes : series) {
    const auto rig = make_rig();
    const auto robot = rig->connect();
    run_steps<Numbers>(*robot, 0, 99);
    robot->finish();
    for (TimeIndex t = 0; t < 100; ++t) {
      for (const Bytes& part : {robot->get_observation(t), robot->get_applied_action(t)}) {
        bytes.insert(bytes.end(), part.begin(), part.end());
      }
    }
  }
  EXPECT_EQ(series[0], series[1]);
}

// --- With deadlines ---

TEST_P(RealTimeContract, HoldsUntilTheFirstAction) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  rig->tick(10);
  static_cast<void>(robot->latest_observation(Timeout::zero()));
  EXPECT_EQ(robot->current_time_index(), -1);
  EXPECT_FALSE(robot->fault().has_value());
  // The initial pose is held in every period.
  EXPECT_EQ(rig->log().holds, 1);
  EXPECT_GE(rig->log().actions, 10);
  EXPECT_EQ(rig->log().actions, rig->log().observations);
}

TEST_P(RealTimeContract, BeginsWithTheFirstTickThatFindsAnAction) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  rig->tick(7);
  EXPECT_EQ(robot->append_desired_action(0), 0);
  EXPECT_EQ(robot->current_time_index(), -1);
  const Instant time_zero = rig->clock().now() + kPeriod;
  rig->tick();
  EXPECT_EQ(robot->current_time_index(), 0);
  const Status status = robot->get_status(0);
  EXPECT_EQ(status.tick, 0);
  EXPECT_EQ(status.time, time_zero.time_since_epoch().count());
}

TEST_P(RealTimeContract, DoesOneStepPerPeriod) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 19);
  for (TimeIndex t = 0; t < 20; ++t) {
    rig->tick();
    ASSERT_EQ(robot->current_time_index(), t);
    const Status status = robot->get_status(t, Timeout::zero());
    EXPECT_EQ(status.tick, t);
    EXPECT_EQ(status.time, (rig->clock().now()).time_since_epoch().count());
    EXPECT_EQ(status.lateness, 0);
    EXPECT_EQ(status.flags, 0U);
  }
  expect_actions(*robot, 20);
  expect_measured_before_acting(rig->log());
}

TEST_P(RealTimeContract, StopsWhenAnActionIsLate) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 4);
  rig->tick(6);
  expect_end(*robot, 5, {.code = Fault::Code::kActionLate});
  EXPECT_EQ(robot->get_status(5).tick, 5);
  EXPECT_EQ(fault_of([&] { return robot->append_desired_action(5); }), robot->fault());
}

TEST_P(RealTimeContract, fault_04_RepeatsALateActionOnlySoOften) {
  const auto rig = make_rig(with_deadlines(3));
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 1);
  rig->tick(2 + 3 + 1);
  expect_end(*robot, 5, {.code = Fault::Code::kActionLate, .detail = 3});
  for (TimeIndex t = 0; t < 5; ++t) {
    EXPECT_EQ(has_flag(*robot, t, Status::kActionRepeated), t >= 2);
    EXPECT_EQ(robot->get_status(t).action_repeats, t >= 2 ? t - 1 : 0);
    EXPECT_EQ(robot->get_desired_action(t), robot->action(std::min<TimeIndex>(t, 1)));
  }
}

TEST_P(RealTimeContract, CountsRepetitionsInARow) {
  const auto rig = make_rig(with_deadlines(2));
  const auto robot = rig->connect();
  rig->tick();
  // It is late twice, then in time once, and so on: never late more than twice in a row.
  for (int i = 0; i < 10; ++i) {
    ASSERT_EQ(robot->append_desired_action(i), 3 * i);
    rig->tick(3);
  }
  EXPECT_EQ(robot->current_time_index(), 29);
  EXPECT_FALSE(robot->fault().has_value());
}

TEST_P(RealTimeContract, fault_04_AppendGoesOnAtTheFirstOpenStepAfterRepetitions) {
  const auto rig = make_rig(with_deadlines(100));
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 0);
  rig->tick(4);
  // Steps 1 to 3 are closed. A loop that was too slow continues at the current step, without any
  // blame.
  static_cast<void>(robot->get_observation(0));
  EXPECT_EQ(robot->append_desired_action(4), 4);
  EXPECT_EQ(robot->append_desired_action(5), 5);
  rig->tick(2);
  EXPECT_EQ(robot->get_desired_action(4), robot->action(4));
  EXPECT_EQ(robot->get_desired_action(5), robot->action(5));
  EXPECT_EQ(robot->get_status(4).flags, 0U);
  EXPECT_EQ(robot->get_status(4).action_repeats, 0U);
  EXPECT_EQ(robot->get_status(5).discarded_actions, 0U) << "nothing was sent for a closed step";
}

TEST_P(RealTimeContract, AnAppendThatReturnsAStepWasAppliedAtThatStep) {
  constexpr TimeIndex kActions = 10'000;
  constexpr TimeIndex kDifferent = 100;
  Plan plan = with_deadlines(1'000'000'000);
  plan.session.history = 1 << 16;
  const auto rig = make_rig(plan);
  const auto robot = rig->connect();
  // The back-end runs its ticks as fast as it can, so steps are closed while an append for them is
  // under way.
  rig->clock().run_free();
  int compared = 0;
  TimeIndex last = -1;
  for (TimeIndex k = 0; k < kActions; ++k) {
    const TimeIndex action = k % kDifferent;
    const TimeIndex t = robot->append_desired_action(action);
    EXPECT_GT(t, last);
    last = t;
    try {
      ASSERT_EQ(robot->get_desired_action(t), robot->action(action)) << t;
      ASSERT_EQ(robot->get_status(t).flags, 0U) << t;
      ++compared;
    } catch (const HistoryLost&) {
      // This thread did not run for the time of a whole history.
    }
  }
  EXPECT_GT(compared, 0);
}

TEST_P(RealTimeContract, SkipsTheTicksThatALateBackendMissed) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 19);
  rig->tick(3);
  // The machine stalls: two ticks are missed, and the third one is seen in time.
  rig->clock().advance(3 * kPeriod);
  rig->clock().wait_for_sleeper();
  rig->tick(2);
  EXPECT_EQ(robot->current_time_index(), 5) << "steps are consecutive, whatever the time";
  for (TimeIndex t = 0; t <= 5; ++t) {
    const Status status = robot->get_status(t);
    EXPECT_EQ(status.tick, t < 3 ? t : t + 2);
    EXPECT_EQ(status.skipped_ticks, t == 3 ? 2U : 0U);
  }
  expect_actions(*robot, 6);
  EXPECT_FALSE(robot->fault().has_value()) << "the user is not to blame";
}

TEST_P(RealTimeContract, KeepsThePhaseHoweverLateItWas) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 39);
  rig->tick();
  for (const int percent : {150, 30, 420, 70, 199, 1, 250, 100, 510, 20}) {
    rig->clock().wait_for_sleeper();
    rig->clock().advance(percent * kPeriod / 100);
  }
  rig->clock().wait_for_sleeper();
  const Status first = robot->get_status(0);
  ASSERT_GE(robot->current_time_index(), 6);
  for (TimeIndex t = 0; t <= robot->current_time_index(); ++t) {
    const Status status = robot->get_status(t);
    EXPECT_EQ(status.time - status.lateness, first.time + status.tick * kPeriod.count()) << t;
    EXPECT_GE(status.lateness, 0);
    EXPECT_LT(status.lateness, kPeriod.count());
  }
}

TEST_P(RealTimeContract, TooManySkippedTicksAreAFault) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 9);
  rig->tick(2);
  rig->clock().advance(6 * kPeriod);
  rig->clock().wait_for_sleeper();
  EXPECT_EQ(robot->get_status(2).skipped_ticks, 5U);
  rig->clock().advance(7 * kPeriod);
  rig->clock().wait_for_sleeper();
  expect_end(*robot, 3, {.code = Fault::Code::kBackendLate, .detail = 6});
  EXPECT_EQ(robot->get_status(3).skipped_ticks, 6U);
}

TEST_P(RealTimeContract, fault_14_EndsWhenTheFirstActionDoesNotCome) {
  Plan plan = with_deadlines();
  plan.backend.first_action_timeout = 10 * kPeriod;
  const auto rig = make_rig(plan);
  const auto robot = rig->connect();
  rig->tick(9);
  EXPECT_FALSE(robot->fault().has_value());
  rig->tick();
  expect_end_before_step_zero(*robot, {.code = Fault::Code::kFirstActionLate});
  EXPECT_EQ(fault_of([&] { return robot->append_desired_action(0); }), robot->fault());
}

TEST_P(RealTimeContract, EndsWhenTheDriverFaultsWhileHolding) {
  // Holding needs both calls in every period.
  for (const bool while_measuring : {true, false}) {
    const auto rig = make_rig(while_measuring ? with_deadlines(0, {.observation_fault_at = 3})
                                              : with_deadlines(0, {.action_fault_at = 3}));
    const auto robot = rig->connect();
    rig->tick(3);
    expect_end_before_step_zero(
        *robot, {.code = Fault::Code::kDriver, .detail = DriverUnderTest::kFaultCode});
  }
}

TEST_P(RealTimeContract, EndsWhenTheDriverFaults) {
  for (const bool while_measuring : {true, false}) {
    const auto rig = make_rig(while_measuring ? with_deadlines(0, {.observation_fault_at = 7})
                                              : with_deadlines(0, {.action_fault_at = 7}));
    const auto robot = rig->connect();
    rig->tick();
    append_ahead<Numbers>(*robot, 0, 9);
    const TimeIndex held = rig->log().actions;  // holding needs calls, too
    rig->tick(static_cast<int>(8 - held));
    expect_end(*robot, 7 - held,
               {.code = Fault::Code::kDriver, .detail = DriverUnderTest::kFaultCode},
               !while_measuring);
    EXPECT_EQ(robot->get_status(7 - held).tick, 7 - held);
  }
}

TEST_P(RealTimeContract, EndsWhenTheControllerLetsGo) {
  const auto rig = make_rig(with_deadlines(100));
  auto robot = rig->connect();
  const auto observer = rig->observe();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 4);
  rig->tick(5);
  robot.reset();
  rig->tick();
  expect_end(*observer, 5, {.code = Fault::Code::kDetached});
}

TEST_P(RealTimeContract, EndsWhenTheBackendIsAskedToStop) {
  Plan plan = with_deadlines(1'000'000'000);
  plan.session.history = 1 << 16;
  const auto rig = make_rig(plan);
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 4);
  rig->tick(5);
  rig->request_stop();
  // The request takes time to reach the other process. Until then the action is repeated.
  while (!robot->fault()) rig->tick();
  const TimeIndex steps = robot->fault()->time_index;
  EXPECT_GE(steps, 5);
  expect_end(*robot, steps, {.code = Fault::Code::kStopped});
}

TEST_P(RealTimeContract, FinishesBehindTheActionsThatWait) {
  const auto rig = make_rig(with_deadlines(0, {.stop_periods = 4}));
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 4);
  EXPECT_THROW(robot->finish(Timeout::zero()), TimedOut);
  rig->tick(6);
  expect_end(*robot, 5, {.code = Fault::Code::kFinished});
  robot->finish();
  EXPECT_EQ(rig->log().stops, 0) << "the orderly stop takes periods of its own";
  rig->tick(5);
  EXPECT_EQ(rig->log().stops, 5);
  // A whole new session begins at once.
  const auto second = rig->connect();
  rig->tick(2);
  EXPECT_EQ(second->append_desired_action(0), 0);
  rig->tick();
  EXPECT_EQ(second->current_time_index(), 0);
}

TEST_P(RealTimeContract, NeedsRecoveryAfterALateAction) {
  const auto rig = make_rig(with_deadlines());
  const auto first = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*first, 0, 1);
  rig->tick(3);
  rig->last_tick();  // for the orderly stop
  expect_end(*first, 2, {.code = Fault::Code::kActionLate});
  first->recover();

  const auto second = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*second, 0, 3);
  rig->tick(4);
  EXPECT_EQ(second->current_time_index(), 3);
  EXPECT_EQ(second->get_status(3).tick, 3);
  expect_end(*first, 2, {.code = Fault::Code::kActionLate});
}

TEST_P(RealTimeContract, PreparesOncePerPeriod) {
  const auto rig = make_rig(with_deadlines(0, {.prepare_periods = 5}));
  const auto robot = rig->connect();
  rig->clock().wait_for_sleeper();
  rig->tick(3);
  EXPECT_EQ(rig->log().prepares, 4);
  EXPECT_EQ(rig->log().observations, 0);
  EXPECT_THROW(static_cast<void>(robot->latest_observation(Timeout::zero())), TimedOut);
  // An early user waits for the robot.
  append_ahead<Numbers>(*robot, 0, 2);
  rig->tick();
  EXPECT_EQ(robot->current_time_index(), -1);
  rig->tick();
  EXPECT_EQ(robot->current_time_index(), 0);
}

TEST_P(RealTimeContract, fault_05_AFullQueueRefusesAndForgetsNothing) {
  Plan plan = with_deadlines();
  plan.session.queue = 8;
  const auto rig = make_rig(plan);
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 7);
  for (int i = 0; i < 3; ++i) {
    EXPECT_THROW(robot->append_desired_action(8, Timeout::zero()), TimedOut);
  }
  rig->tick();
  append_ahead<Numbers>(*robot, 8, 8);
  rig->tick(8);
  expect_actions(*robot, 9);
}

TEST_P(RealTimeContract, WakesEveryWaiterAtTheEnd) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  const auto observer = rig->observe();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 2);
  std::vector<std::optional<Fault>> faults(12);
  std::vector<std::thread> waiters;
  waiters.reserve(faults.size());
  for (std::size_t i = 0; i < faults.size(); ++i) {
    // There are more waiters than wait slots; half of them can only poll.
    waiters.emplace_back([&, i] {
      const AnyUser& user = i % 2 == 0 ? *robot : *observer;
      faults[i] = fault_of([&] { return user.get_status(100); });
    });
  }
  rig->tick(4);
  for (std::thread& waiter : waiters) waiter.join();
  const Fault late{.code = Fault::Code::kActionLate, .detail = 0, .time_index = 3};
  EXPECT_THAT(faults, ::testing::Each(late));
}

TEST_P(RealTimeContract, WakesReadersStepByStep) {
  const auto rig = make_rig(with_deadlines());
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 49);
  std::thread reader([&] {
    for (TimeIndex t = 0; t < 50; ++t) robot->wait_until_time_index(t);
  });
  rig->tick(50);
  reader.join();
}

TEST_P(RealTimeContract, LetsNobodyWaitLongerThanTheyWant) {
  const auto rig = make_rig(with_deadlines(100));
  const auto robot = rig->connect();
  rig->tick();
  EXPECT_THROW(static_cast<void>(robot->get_observation(0, Timeout::zero())), TimedOut);
  append_ahead<Numbers>(*robot, 0, 0);
  rig->tick();
  // The manual clock does not move; the timeout counts the user's time.
  for (const Timeout timeout : {Timeout::zero(), Timeout(std::chrono::milliseconds(5))}) {
    EXPECT_THROW(static_cast<void>(robot->get_observation(1, timeout)), TimedOut);
    EXPECT_THROW(static_cast<void>(robot->get_desired_action(1, timeout)), TimedOut);
    EXPECT_THROW(static_cast<void>(robot->get_applied_action(1, timeout)), TimedOut);
    EXPECT_THROW(static_cast<void>(robot->get_status(1, timeout)), TimedOut);
    EXPECT_THROW(robot->wait_until_time_index(1, timeout), TimedOut);
    EXPECT_THROW(static_cast<void>(robot->get_observations(0, 3, timeout)), TimedOut);
    EXPECT_THROW(robot->finish(timeout), TimedOut);
  }
}

TEST_P(RealTimeContract, ClosesNoStepBeforeItsTick) {
  const auto rig = make_rig(with_deadlines(100));
  const auto robot = rig->connect();
  rig->tick();
  append_ahead<Numbers>(*robot, 0, 0);
  rig->tick();
  // The user answers within the period, like a program that keeps up.
  for (TimeIndex t = 1; t < 30; ++t) {
    static_cast<void>(robot->get_observation(t - 1));
    EXPECT_EQ(robot->append_desired_action(t), t);
    rig->tick();
    EXPECT_EQ(robot->get_status(t).flags, 0U);
  }
}

}  // namespace
}  // namespace trifinger::test
