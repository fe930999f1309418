// SPDX-License-Identifier: BSD-3-Clause
#include "core/timing_contract.hpp"

#include "core/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using Drivers = AllTransports<FakeDriverTraits, OddDriverTraits>;
INSTANTIATE_TYPED_TEST_SUITE_P(Core, TimingContract, Drivers, CaseName);

}  // namespace
}  // namespace trifinger::test
