// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/backend.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <stdexcept>
#include <vector>

#include "core/driver_under_test.hpp"
#include "core/fake_robot.hpp"
#include "core/fault_of.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::test {
namespace {

// What the function that is called after every session has seen.
struct Seen {
  Fault fault;
  std::uint64_t session_id;
  std::int64_t stops;

  friend bool operator==(const Seen&, const Seen&) = default;
};

TEST(Backend, CallsItsOwnerBetweenSessionsWhenTheRobotIsAtRest) {
  CallLog log;
  DriverUnderTest driver(std::make_unique<FakeDriver>(FakeDriver::Options{}),
                         {.stop_periods = 3, .action_fault_at = 2}, log);
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  std::vector<Seen> seen;
  backend.set_after_session([&](const Fault& fault) {
    // The session that has ended is still the current one.
    seen.push_back({fault, host.open().info().session_id, log.stops});
  });
  BackendThread thread(backend);

  std::vector<Seen> expected;
  const auto end = [&](const Frontend<FakeRobot>& robot) {
    const auto fault = fault_of([&] { return robot.get_status(1000); });
    const auto stops = 4 * (static_cast<std::int64_t>(expected.size()) + 1);
    expected.push_back({fault.value_or(Fault{}), robot.session().info().session_id, stops});
  };
  {
    Frontend<FakeRobot> robot(host);
    for (int i = 0; i < 3; ++i) robot.append_desired_action({});
    end(robot);
    robot.recover();
  }
  {
    Frontend<FakeRobot> robot(host);
    robot.append_desired_action({});
    robot.finish();
    end(robot);
  }
  const Frontend<FakeRobot> robot(host);
  thread.stop();
  end(robot);

  EXPECT_EQ(seen, expected);
  EXPECT_EQ(seen.at(0).fault.code, Fault::Code::kDriver);
  EXPECT_EQ(seen.at(1).fault.code, Fault::Code::kFinished);
  EXPECT_EQ(seen.at(2).fault.code, Fault::Code::kStopped);
}

TEST(Backend, EndsWithWhatItsOwnerThrowsBetweenSessions) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  backend.set_after_session([](const Fault&) { throw std::runtime_error("the disk is full"); });
  BackendThread thread(backend);
  Frontend<FakeRobot>(host).finish();
  EXPECT_THAT([&] { thread.stop(); },
              testing::ThrowsMessage<std::runtime_error>("the disk is full"));
}

TEST(BackendThread, TellsWhenTheBackendHasEnded) {
  FakeDriver driver;
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  std::atomic<bool> was_reported{false};
  BackendThread thread(backend, {.demand = Demand::kOff}, [&] {
    was_reported = true;
    was_reported.notify_all();
  });
  EXPECT_FALSE(thread.wait_for_end(Timeout::zero()));
  backend.request_stop();
  was_reported.wait(false);
  EXPECT_TRUE(thread.wait_for_end(Timeout::zero()));
  EXPECT_TRUE(thread.wait_for_end(kForever));
  thread.stop();
}

}  // namespace
}  // namespace trifinger::test
