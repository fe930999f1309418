// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/fake_robot.hpp"
#include "core/named_robot.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/payload.hpp"
#include "trifinger/core/sensor.hpp"

// What a program does wrong with the objects of this library is told in a sentence.

namespace trifinger::test {
namespace {

using ::testing::HasSubstr;

constexpr TimeIndex kSmallest = std::numeric_limits<TimeIndex>::min();
constexpr TimeIndex kLargest = std::numeric_limits<TimeIndex>::max();

// ---- objects that were moved ----

class MovedObject : public ::testing::Test {
 protected:
  static void expect_sentence(const std::vector<std::function<void()>>& calls) {
    for (std::size_t i = 0; i < calls.size(); ++i) {
      EXPECT_THAT(message_of<InvalidArgument>([&] {
                    calls[i]();
                    return 0;
                  }),
                  HasSubstr("after it had been moved: use the object that it was moved to"))
          << "call " << i;
    }
  }

  SessionFolder folder_;
};

TEST_F(MovedObject, fault_82_AFrontendSaysSoInEveryFunction) {
  const NamedRobot robot;
  Frontend<FakeRobot> moved("robot");
  Frontend<FakeRobot> user(std::move(moved));
  std::vector<FakeObservation> observations(2);
  // NOLINTBEGIN(bugprone-use-after-move): this is what the test is about
  expect_sentence({
      [&] { static_cast<void>(moved.append_desired_action({})); },
      [&] { static_cast<void>(moved.append_desired_actions(std::vector<FakeAction>(2))); },
      [&] { static_cast<void>(moved.get_observation(0)); },
      [&] { static_cast<void>(moved.get_desired_action(0)); },
      [&] { static_cast<void>(moved.get_status(0)); },
      [&] { moved.get_observations(0, observations); },
      [&] { static_cast<void>(moved.latest_observation()); },
      [&] { moved.wait_until_time_index(0); },
      [&] { static_cast<void>(moved.current_time_index()); },
      [&] { moved.finish(); },
      [&] { moved.recover(); },
      [&] { static_cast<void>(moved.fault()); },
      [&] { static_cast<void>(moved.timing()); },
      [&] { static_cast<void>(moved.companion("sensor")); },
      [&] { static_cast<void>(moved.session()); },
  });
  UntypedFrontend sensor = user.companion("sensor");
  const UntypedFrontend other(std::move(sensor));
  FakeSensorReading reading;
  expect_sentence({
      [&] { static_cast<void>(sensor.try_get(Series::kObservation, 0, &reading)); },
      [&] { static_cast<void>(sensor.get_latest_at(0, &reading, Timeout::zero())); },
      [&] { static_cast<void>(sensor.payload(&reading)); },
      [&] { static_cast<void>(sensor.range(Series::kObservation)); },
      [&] { sensor.set_interrupt({}); },
  });
  // It can be assigned to.
  moved = std::move(user);
  EXPECT_EQ(moved.append_desired_action({}), 0);
  // NOLINTEND(bugprone-use-after-move)
}

TEST_F(MovedObject, fault_82_AHostAndASessionSaySo) {
  SessionHost moved = SessionHost::named("robot");
  const SessionHost host(std::move(moved));
  FakeDriver driver;
  // NOLINTBEGIN(bugprone-use-after-move): this is what the test is about
  expect_sentence({
      [&] { static_cast<void>(moved.open()); },
      [&] { static_cast<void>(moved.place()); },
      [&] { const Backend backend(driver, moved); },
  });
  const NamedRobot robot("other");
  Session session = Session::open("other");
  const Session kept(std::move(session));
  expect_sentence({
      [&] { static_cast<void>(session.info()); },
      [&] { static_cast<void>(session.timing()); },
      [&] { static_cast<void>(session.documents()); },
      [&] { static_cast<void>(session.element(Series::kObservation)); },
      [&] { static_cast<void>(session.companion("sensor")); },
      [&] { const Frontend<FakeRobot> observer(session); },
  });
  UntypedSensorReader reader("robot", "object", describe<FakeSensorReading>());
  const UntypedSensorReader next(std::move(reader));
  FakeSensorReading reading;
  expect_sentence({[&] { static_cast<void>(reader.next(&reading, Timeout::zero())); }});
  // NOLINTEND(bugprone-use-after-move)
}

TEST(MovedObjectDeathTest, fault_82_EndsTheProgramWithTheSentenceWhereNothingCanBeThrown) {
  PayloadWriter moved = PayloadWriter::anonymous(describe<FakeObservation>(), 2);
  const PayloadWriter writer(std::move(moved));
  // NOLINTNEXTLINE(bugprone-use-after-move): this is what the test is about
  EXPECT_DEATH(static_cast<void>(moved.begin()), "use the object that it was moved to");
}

// ---- a back-end that is destroyed too early ----

TEST(InlineBackend, fault_82_DestroyedBeforeItsFrontEndIsToldAndHarmsNobody) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  std::optional<Backend> backend(std::in_place, driver, host,
                                 BackendOptions{.mode = BackendOptions::Mode::kNonRealTime});
  std::optional<Frontend<FakeRobot>> user(std::in_place, *backend);
  std::optional<Frontend<FakeRobot>> observer(std::in_place, *backend,
                                              FrontendOptions{.control = false});
  static_cast<void>(user->append_desired_action({.setpoint = 1.0}));
  EXPECT_EQ(user->get_observation(0).applied_actions, 0);
  backend.reset();
  // What was measured can be read; the session has ended.
  EXPECT_EQ(user->get_observation(0).applied_actions, 0);
  EXPECT_THROW(static_cast<void>(user->get_observation(5)), RobotStopped);
  EXPECT_THROW(static_cast<void>(user->append_desired_action({})), RobotStopped);
  for (auto* const handle : {&user, &observer}) {
    EXPECT_THAT(message_of<InvalidArgument>([&] {
                  (*handle)->recover();
                  return 0;
                }),
                HasSubstr("let the back-end live longer than its front-ends"));
  }
  // Another back-end in the same place is not taken for it.
  backend.emplace(driver, host, BackendOptions{.mode = BackendOptions::Mode::kNonRealTime});
  EXPECT_THROW(user->recover(), InvalidArgument);
  user.reset();
  observer.reset();
}

// ---- the ends of the numbers ----

TEST(ExtremeNumbers, fault_82_OfStepsAreRefusedOrNotThere) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host, {.mode = BackendOptions::Mode::kNonRealTime});
  Frontend<FakeRobot> user(backend);
  static_cast<void>(user.append_desired_action({}));
  std::vector<FakeObservation> two(2);
  for (const TimeIndex t : {kLargest, kLargest - 1}) {
    EXPECT_THROW(static_cast<void>(user.get_observation(t)), Error) << t;
    EXPECT_THROW(user.wait_until_time_index(t), Error) << t;
    EXPECT_THROW(user.get_observations(t, two), Error) << t;
  }
  EXPECT_THAT(message_of<InvalidArgument>([&] {
                user.get_observations(kLargest, two);
                return 0;
              }),
              HasSubstr("2 steps from step 9223372036854775807 on reach beyond"));
  for (const TimeIndex t : {kSmallest, kSmallest + 1, TimeIndex{-1}}) {
    EXPECT_THROW(static_cast<void>(user.get_observation(t)), InvalidArgument) << t;
    EXPECT_THROW(user.get_observations(t, two), InvalidArgument) << t;
  }
}

TEST(ExtremeNumbers, fault_82_OfTimesAreRefusedOrMeanNow) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  for (const Nanoseconds period :
       {Nanoseconds::min(), Nanoseconds(-1), Nanoseconds::zero(), Nanoseconds::max()}) {
    EXPECT_THAT(message_of<InvalidArgument>([&] {
                  const Backend backend(driver, host, {.period = period});
                  return 0;
                }),
                HasSubstr("allowed are positive times up to 1 h"));
  }
  for (const Timeout timeout : {Timeout::min(), Timeout::min() + Timeout(1), Timeout(-1)}) {
    EXPECT_TRUE(Deadline(timeout).passed());
  }
  EXPECT_FALSE(Deadline(kForever - Timeout(1)).passed());
  EXPECT_EQ(duration_text(Nanoseconds::max()), "9223372037 s");
}

}  // namespace
}  // namespace trifinger::test
