// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <string>

namespace trifinger::detail {

// Writes a model as a text that needs no other file. `model` was compiled from `spec`. Throws
// Error.
[[nodiscard]] std::string self_contained_mjcf(const mjSpec& spec, const mjModel& model);

}  // namespace trifinger::detail
