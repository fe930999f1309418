// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::detail {

// A sentence for each joint of a robot from a file whose damping is too strong for its inertia: in
// one step it would turn the joint's velocity around.
[[nodiscard]] std::map<std::size_t, std::string> gain_warnings(const SimulationOptions& options);

}  // namespace trifinger::detail
