// SPDX-License-Identifier: BSD-3-Clause
#include "joint/hold_action.hpp"

#include <cstddef>
#include <cstring>

#include "trifinger/base/error.hpp"
#include "trifinger/core/description.hpp"

namespace trifinger {

HoldAction hold_action_of(const Session& session) {
  const RobotTypes& robot = session.description();
  const FieldDescription* const from = robot.observation.find("position");
  const FieldDescription* const to = robot.action.find("position");
  if (from == nullptr || to == nullptr || from->type != to->type || from->shape != to->shape) {
    throw InvalidArgument("a robot of type '" + session.info().type +
                          "' has no joint positions to hold");
  }
  return [source = from->offset, target = to->offset, size = from->count() * size_of(from->type)](
             const void* observation, void* action) {
    std::memcpy(static_cast<std::byte*>(action) + target,
                static_cast<const std::byte*>(observation) + source, size);
  };
}

}  // namespace trifinger
