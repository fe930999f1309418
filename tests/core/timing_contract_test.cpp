// SPDX-License-Identifier: BSD-3-Clause
#include "core/timing_contract.hpp"

#include "core/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

INSTANTIATE_TEST_SUITE_P(Core, TimingContract,
                         (on_all_transports<FakeDriverTraits, OddDriverTraits>()), case_name);
INSTANTIATE_TEST_SUITE_P(Core, RealTimeContract,
                         (on_threaded_transports<FakeDriverTraits, OddDriverTraits>()), case_name);

}  // namespace
}  // namespace trifinger::test
