// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <new>

#include "core/steps.hpp"
#include "core/transports.hpp"
#include "support/allocation_counter.hpp"

// Checks that the loop of no driver takes memory from the heap. The test program is built with
// support/allocation_counter.cpp:
//
//     using Drivers = ::testing::Types<SimDriverTraits>;
//     INSTANTIATE_TYPED_TEST_SUITE_P(Sim, AllocationContract, Drivers);

namespace trifinger::test {

/// Number of allocations by the loop's thread since the first observation, at observation i.
struct LoopAllocations {
  static constexpr std::size_t kSize = 1024;

  static void note() {
    thread_local const AllocationCounter allocations;
    // relaxed: the test's clock orders the loop's thread and the reader's.
    const std::size_t i = count().fetch_add(1, std::memory_order_relaxed);
    totals().at(i % kSize).store(allocations.count(), std::memory_order_relaxed);
  }
  static std::atomic<std::size_t>& count() {
    static std::atomic<std::size_t> value{0};
    return value;
  }
  static std::array<std::atomic<std::size_t>, kSize>& totals() {
    static std::array<std::atomic<std::size_t>, kSize> values{};
    return values;
  }
};

template <class T>
class AllocationContract : public ::testing::Test {};
TYPED_TEST_SUITE_P(AllocationContract);

TYPED_TEST_P(AllocationContract, TheCounterCounts) {
  const AllocationCounter allocations;
  ::operator delete(::operator new(1));  // a direct call, which the compiler must not remove
  EXPECT_EQ(allocations.count(), 1U);
}

TYPED_TEST_P(AllocationContract, NoTickWithoutDeadlinesAllocates) {
  const auto driver = TypeParam::make_driver();
  SessionHost host = SessionHost::anonymous();
  Backend backend(*driver, host);
  Frontend<typename TypeParam::Robot> robot(backend);
  for (TimeIndex t = 0; t < 100; ++t) {
    robot.append_desired_action(TypeParam::action(t));
    const AllocationCounter allocations;
    while (backend.advance() == Progress::kStepped) {
    }
    ASSERT_EQ(allocations.count(), 0U) << t;
  }
  // The end with the orderly stop does not allocate either.
  backend.request_stop();
  const AllocationCounter allocations;
  while (backend.advance() != Progress::kEnded) {
  }
  EXPECT_EQ(allocations.count(), 0U);
}

TYPED_TEST_P(AllocationContract, NoTickWithDeadlinesAllocates) {
  LoopAllocations::count() = 0;
  Plan plan = with_deadlines(1000, {.on_observation = &LoopAllocations::note});
  typename InProcess::Rig<TypeParam> rig(plan);
  auto robot = rig.connect();
  rig.tick(10);  // holding
  append_ahead<TypeParam>(robot, 0, 19);
  rig.tick(20);
  rig.tick(10);                      // repeating
  rig.clock().advance(3 * kPeriod);  // skipping
  rig.tick(10);
  const std::size_t count = LoopAllocations::count();
  ASSERT_GE(count, 50U);
  // Starts at the second step: the first one belongs to the beginning of the session.
  for (std::size_t i = 2; i < count; ++i) {
    ASSERT_EQ(LoopAllocations::totals().at(i), LoopAllocations::totals().at(1)) << i;
  }
}

REGISTER_TYPED_TEST_SUITE_P(AllocationContract, TheCounterCounts, NoTickWithoutDeadlinesAllocates,
                            NoTickWithDeadlinesAllocates);

}  // namespace trifinger::test
