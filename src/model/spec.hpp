// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <optional>

#include "trifinger/model/robot_model.hpp"

namespace trifinger::detail {

struct DeleteSpec {
  void operator()(mjSpec* spec) const noexcept { mj_deleteSpec(spec); }
};
using Spec = std::unique_ptr<mjSpec, DeleteSpec>;

// Returns a spec, ready to compile, for everything in `description`. Throws InvalidArgument.
[[nodiscard]] Spec make_spec(const RobotDescription& description, Detail detail);

// Returns which surface a geom with these collision masks and this priority has; nothing if it
// never touches anything.
[[nodiscard]] std::optional<Surface> surface_of(int contype, int priority) noexcept;

// The simulation must see numbers that are not finite: MuJoCo must not reset silently. Files do not
// say it, because MuJoCo Warp refuses this flag.
void leave_divergence_visible(mjModel& model) noexcept;

// Throws Error with MuJoCo's own words. After `validate`, a refusal is a bug of ours.
[[nodiscard]] SceneModel::Compiled compile(mjSpec* spec);

}  // namespace trifinger::detail
