// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <string>

#include "trifinger/base/error.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::manipulation {

// The box of this name. @throws InvalidArgument if the scene has none
[[nodiscard]] inline const ObjectDescription& box_of(const RobotDescription& description,
                                                     const std::string& name) {
  const auto found = std::ranges::find(description.objects, name, &ObjectDescription::name);
  if (found == description.objects.end() || found->shape != ObjectShape::kBox)
    throw InvalidArgument("the scene has no box '" + name + "'");
  return *found;
}

}  // namespace trifinger::manipulation
