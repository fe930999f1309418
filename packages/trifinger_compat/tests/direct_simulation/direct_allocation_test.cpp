// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "direct_simulation.hpp"
#include "support/malloc_counter.hpp"

namespace trifinger::test {
namespace {

using bindings::DirectSimulation;

TEST(DirectAllocation, AStepNeedsNoMemory) {
  DirectSimulation<TriFinger> direct({});
  TriFinger::Action applied;
  // The first contacts of the cube come with memory that MuJoCo keeps.
  ASSERT_TRUE(direct.step({}));
  const MallocCounter allocations;
  for (int i = 0; i < 100; ++i) {
    direct.apply_control({}, {.max_torque = 0.3}, applied);
    ASSERT_TRUE(direct.step(applied.torque));
  }
  EXPECT_EQ(allocations.count(), 0);
}

}  // namespace
}  // namespace trifinger::test
