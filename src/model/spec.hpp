// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <optional>

#include "trifinger/model/robot_model.hpp"

namespace trifinger::model {

struct DeleteSpec {
  void operator()(mjSpec* spec) const noexcept { mj_deleteSpec(spec); }
};
using Spec = std::unique_ptr<mjSpec, DeleteSpec>;

// Everything that `description` says, ready to compile. Throws InvalidArgument.
[[nodiscard]] Spec make_spec(const RobotDescription& description, Detail detail);

// What a geom with these collision masks and this priority is; nothing if it touches nothing.
[[nodiscard]] std::optional<Surface> surface_of(int contype, int priority) noexcept;

// Throws Error with MuJoCo's own words: after `validate` a refusal is a defect of ours.
[[nodiscard]] RobotModel::Compiled compile(mjSpec* spec);

}  // namespace trifinger::model
