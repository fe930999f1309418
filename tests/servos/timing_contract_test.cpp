// SPDX-License-Identifier: BSD-3-Clause
#include "core/timing_contract.hpp"

#include "servos/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using servos::test::ServoRobotTraits;

INSTANTIATE_TEST_SUITE_P(Servos, TimingContract, on_all_transports<ServoRobotTraits>(), case_name);
INSTANTIATE_TEST_SUITE_P(Servos, RealTimeContract, on_threaded_transports<ServoRobotTraits>(),
                         case_name);

}  // namespace
}  // namespace trifinger::test
