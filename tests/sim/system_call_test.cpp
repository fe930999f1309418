// SPDX-License-Identifier: BSD-3-Clause
#include "core/system_call_contract.hpp"
#include "sim/drivers_of_tests.hpp"

namespace trifinger::test {
namespace {

using Drivers = ::testing::Types<SimulatedRobotTraits<TriFinger>, SimulatedRobotTraits<Finger>,
                                 FileRobotTraits>;
INSTANTIATE_TYPED_TEST_SUITE_P(Sim, SystemCallContract, Drivers);

}  // namespace
}  // namespace trifinger::test
