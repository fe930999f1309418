// SPDX-License-Identifier: BSD-3-Clause
#include "core/allocation_contract.hpp"
#include "sim/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using DriversThatMayNotAllocate = ::testing::Types<SimulatedRobotTraits<TriFinger>,
                                                   SimulatedRobotTraits<Finger>, FileRobotTraits>;
INSTANTIATE_TYPED_TEST_SUITE_P(Sim, AllocationContract, DriversThatMayNotAllocate);

}  // namespace
}  // namespace trifinger::test
