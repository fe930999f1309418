// SPDX-License-Identifier: BSD-3-Clause
#include "core/steps.hpp"

#include <cstdint>
#include <optional>

#include "core/fault_of.hpp"

namespace trifinger::test {

void expect_end(const AnyObserver& robot, TimeIndex steps, const Fault& expected,
                bool has_last_observation) {
  // Waits for the end.
  const std::optional<Fault> fault = fault_of([&] { return robot.get_status(steps + 1); });
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(name_of(fault->code), name_of(expected.code));
  EXPECT_EQ(fault->detail, expected.detail);
  EXPECT_EQ(fault->time_index, steps);
  EXPECT_EQ(robot.fault(), fault);

  for (TimeIndex t = 0; t < steps; ++t) {
    static_cast<void>(robot.get_observation(t));
    static_cast<void>(robot.get_desired_action(t));
    static_cast<void>(robot.get_applied_action(t));
    const Status status = robot.get_status(t);
    ASSERT_EQ(status.flags & Status::kEnd, 0U) << t;
    ASSERT_EQ(status.fault_code, 0) << t;
  }
  const Status end = robot.get_status(steps);
  EXPECT_NE(end.flags & Status::kEnd, 0U);
  EXPECT_EQ(end.fault_code, static_cast<std::int32_t>(expected.code));
  EXPECT_EQ(end.fault_detail, expected.detail);

  EXPECT_EQ(robot.current_time_index(), has_last_observation ? steps : steps - 1);
  const TimeIndex observations = steps + (has_last_observation ? 1 : 0);
  // The answer stays the same for ever.
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(fault_of([&] { return robot.get_observation(observations); }), fault);
    EXPECT_EQ(fault_of([&] { return robot.get_desired_action(steps); }), fault);
    EXPECT_EQ(fault_of([&] { return robot.get_applied_action(steps); }), fault);
    EXPECT_EQ(fault_of([&] { return robot.get_status(steps + 1); }), fault);
    EXPECT_EQ(fault_of([&] {
                robot.wait_until_time_index(observations);
                return 0;
              }),
              fault);
  }
}

}  // namespace trifinger::test
