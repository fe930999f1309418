// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "sim/bare_driver.hpp"
#include "support/malloc_counter.hpp"
#include "trifinger/sim/hand.hpp"

namespace trifinger::test {
namespace {

TEST(HandAllocation, PullingNeedsNoMemoryNotEvenForMatrices) {
  BareDriver<TriFinger> driver{{.has_hand = true}};
  for (std::int64_t body = 0; body < 4; ++body) {
    driver.robot.pull(body, {.target = {0.0, 0.0, 0.2}, .stiffness = 50.0});
    static_cast<void>(driver.step({}));
    const MallocCounter allocations;
    for (int i = 0; i < 100; ++i) {
      static_cast<void>(driver.step({}));
      HandObservation hand;
      static_cast<void>(driver.robot.get_companion_element(1, i, &hand));
    }
    EXPECT_EQ(allocations.count(), 0) << body;
  }
}

}  // namespace
}  // namespace trifinger::test
