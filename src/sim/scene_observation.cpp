// SPDX-License-Identifier: BSD-3-Clause
#include "sim/scene_observation.hpp"

#include <mujoco/mujoco.h>

#include <cstring>
#include <utility>
#include <vector>

namespace trifinger {
CompanionDescription scene_companion(const SceneModel& model) {
  std::vector<FieldDescription> fields;
  for (FieldDescription field : describe<Stamp>().fields()) {
    field.name = "stamp." + field.name;
    fields.push_back(std::move(field));
  }
  std::size_t offset = sizeof(Stamp);
  const auto append = [&](const char* name, auto count) {
    fields.push_back({.name = name,
                      .type = ScalarType::kFloat64,
                      .shape = {static_cast<std::size_t>(count)},
                      .unit = "",
                      .offset = offset});
    offset += static_cast<std::size_t>(count) * sizeof(double);
  };
  append("position", model.mujoco()->nq);
  append("velocity", model.mujoco()->nv);
  return {.name = kSceneCompanion,
          .type = "scene_observation",
          .element = ElementDescription(std::move(fields))};
}

std::size_t configuration_size(const SceneModel& model) noexcept {
  return static_cast<std::size_t>(model.mujoco()->nq + model.mujoco()->nv);
}

void write_scene(const Stamp& stamp, std::span<const double> position,
                 std::span<const double> velocity, std::byte* element) noexcept {
  std::memcpy(element, &stamp, sizeof(stamp));
  std::memcpy(element + sizeof(stamp), position.data(), position.size_bytes());
  std::memcpy(element + sizeof(stamp) + position.size_bytes(), velocity.data(),
              velocity.size_bytes());
}

}  // namespace trifinger
