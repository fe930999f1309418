// SPDX-License-Identifier: BSD-3-Clause
#include "core/timing_contract.hpp"

#include "sim/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using TriFingerTraits = SimulatedRobotTraits<TriFinger>;
using FingerTraits = SimulatedRobotTraits<Finger>;

INSTANTIATE_TEST_SUITE_P(Sim, TimingContract,
                         (on_all_transports<TriFingerTraits, FingerTraits, FileRobotTraits>()),
                         case_name);
INSTANTIATE_TEST_SUITE_P(Sim, RealTimeContract,
                         (on_threaded_transports<TriFingerTraits, FingerTraits, FileRobotTraits>()),
                         case_name);

}  // namespace
}  // namespace trifinger::test
