// SPDX-License-Identifier: BSD-3-Clause
#include "core/timing_contract.hpp"

#include "sim/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using Everywhere = AllTransports<SimulatedRobotTraits<TriFinger>, SimulatedRobotTraits<Finger>>;
INSTANTIATE_TYPED_TEST_SUITE_P(Sim, TimingContract, Everywhere, CaseName);

using WithTime = ThreadedTransports<SimulatedRobotTraits<TriFinger>, SimulatedRobotTraits<Finger>>;
INSTANTIATE_TYPED_TEST_SUITE_P(Sim, RealTimeContract, WithTime, CaseName);

}  // namespace
}  // namespace trifinger::test
