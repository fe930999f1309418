// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <vector>

#include "random_networks.hpp"
#include "support/allocation_counter.hpp"
#include "support/malloc_counter.hpp"
#include "trifinger/learning/policy.hpp"

namespace trifinger::learning {
namespace {

TEST(Policy, AllocatesNothingOnceItIsMade) {
  Random random{.seed = 3};
  for (int i = 0; i < 50; ++i) {
    const trifinger::test::MallocCounter making;
    Policy policy(test::random_network(random),
                  i % 2 == 0 ? Precision::kDouble : Precision::kSingle);
    EXPECT_GT(making.count(), 0);  // so Eigen's memory is seen
    const std::vector<double> observation = test::random_observation(random, policy.num_inputs());
    std::vector<double> action(policy.num_outputs());
    const trifinger::test::AllocationCounter by_new;
    const trifinger::test::MallocCounter by_malloc;
    ASSERT_TRUE(policy.evaluate(observation, action));
    EXPECT_EQ(by_new.count(), 0);
    EXPECT_EQ(by_malloc.count(), 0);
  }
}

}  // namespace
}  // namespace trifinger::learning
