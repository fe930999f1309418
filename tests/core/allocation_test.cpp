// SPDX-License-Identifier: BSD-3-Clause
#include "core/allocation_contract.hpp"
#include "core/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using Drivers = ::testing::Types<FakeDriverTraits, OddDriverTraits>;
INSTANTIATE_TYPED_TEST_SUITE_P(Core, AllocationContract, Drivers);

}  // namespace
}  // namespace trifinger::test
