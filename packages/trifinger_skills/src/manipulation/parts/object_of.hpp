// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <string>

#include "trifinger/base/error.hpp"
#include "trifinger/control/motion.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::manipulation {

// An object that was not found for so long is not there.
inline constexpr control::Seconds kLongestLook{5.0};

// The object of that name. @throws InvalidArgument if the scene has none
[[nodiscard]] inline const ObjectDescription& object_of(const RobotDescription& description,
                                                        const std::string& name) {
  const auto object = std::ranges::find(description.objects, name, &ObjectDescription::name);
  if (object == description.objects.end())
    throw InvalidArgument("the scene has no '" + name + "' to handle");
  return *object;
}

// The same. @throws InvalidArgument also if it has another shape
[[nodiscard]] inline const ObjectDescription& object_of(const RobotDescription& description,
                                                        const std::string& name,
                                                        ObjectShape shape) {
  const ObjectDescription& object = object_of(description, name);
  if (object.shape != shape) throw InvalidArgument("the object '" + name + "' has another shape");
  return object;
}

}  // namespace trifinger::manipulation
