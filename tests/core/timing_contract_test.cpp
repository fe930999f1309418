// SPDX-License-Identifier: BSD-3-Clause
#include "core/timing_contract.hpp"

#include "core/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using Everywhere = AllTransports<FakeDriverTraits, OddDriverTraits>;
INSTANTIATE_TYPED_TEST_SUITE_P(Core, TimingContract, Everywhere, CaseName);

using WithTime = ThreadedTransports<FakeDriverTraits, OddDriverTraits>;
INSTANTIATE_TYPED_TEST_SUITE_P(Core, RealTimeContract, WithTime, CaseName);

}  // namespace
}  // namespace trifinger::test
