// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <span>

#include "trifinger/model/robot_description.hpp"

namespace trifinger::detail {

// Throws InvalidArgument if a number makes no sense.
void validate_object(const ObjectDescription& object);

// The orientation of an object, with length 1.
[[nodiscard]] std::array<double, 4> unit_quaternion(const ObjectDescription& object);

// Adds these objects to the scene of a robot from a file, which has never been compiled. They touch
// whatever shapes touch in MuJoCo unless the file says otherwise. In the file's key frames they are
// where they begin.
// Throws InvalidArgument if an object has no position, or if a number makes no sense.
void add_objects(mjSpec* spec, std::span<const ObjectDescription> objects);

}  // namespace trifinger::detail
