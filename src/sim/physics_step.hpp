// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/time.hpp"

namespace trifinger::sim {

// The time step of MuJoCo's integration.
inline constexpr Nanoseconds kPhysicsStep = std::chrono::milliseconds(1);

}  // namespace trifinger::sim
