// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>

#include "trifinger/core/driver.hpp"
#include "trifinger/model/scene_model.hpp"

namespace trifinger {

/// Name of the companion that says where everything in a simulated scene really is, without delay
/// and noise: for cameras that are drawn, for viewers, and as the truth in evaluations.
inline constexpr const char* kSceneCompanion = "scene";

/// Describes this companion. An element has a stamp and MuJoCo's configuration: "position", that is
/// `qpos`, and "velocity", that is `qvel`. `SimulatedRobot::configuration` gives the same numbers.
[[nodiscard]] CompanionDescription scene_companion(const SceneModel& model);

/// Number of values of "position" and of "velocity" together.
[[nodiscard]] std::size_t configuration_size(const SceneModel& model) noexcept;

/// Writes an element of that companion.
void write_scene(const Stamp& stamp, std::span<const double> position,
                 std::span<const double> velocity, std::byte* element) noexcept;

}  // namespace trifinger
