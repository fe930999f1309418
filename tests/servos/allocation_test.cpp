// SPDX-License-Identifier: BSD-3-Clause
#include "core/allocation_contract.hpp"
#include "servos/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using DriversThatMayNotAllocate = ::testing::Types<servos::test::ServoRobotTraits>;
INSTANTIATE_TYPED_TEST_SUITE_P(Servos, AllocationContract, DriversThatMayNotAllocate);

}  // namespace
}  // namespace trifinger::test
