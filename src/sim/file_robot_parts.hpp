// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <span>

#include "trifinger/model/model_file.hpp"

namespace trifinger::detail {

// False if a simulation has diverged.
[[nodiscard]] bool is_finite(const mjModel& model, const mjData& data) noexcept;

// The torques that keep the driven joints at rest against gravity and what else acts on them. It
// changes no position and no velocity.
void compute_weight(const ModelFile& model, mjData& data, std::span<double> torque) noexcept;

}  // namespace trifinger::detail
