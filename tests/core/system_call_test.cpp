// SPDX-License-Identifier: BSD-3-Clause
#include "core/drivers_of_tests.hpp"
#include "core/system_call_contract.hpp"

namespace trifinger::test {
namespace {

using Drivers = ::testing::Types<FakeDriverTraits, OddDriverTraits>;
INSTANTIATE_TYPED_TEST_SUITE_P(Core, SystemCallContract, Drivers);

}  // namespace
}  // namespace trifinger::test
