// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/scene_observation.hpp"

#include <cstring>
#include <utility>
#include <vector>

namespace trifinger {
namespace {

// A free body has three coordinates and a quaternion, but six velocities.
std::size_t num_positions(const RobotDescription& description) noexcept {
  return static_cast<std::size_t>(num_joints(description)) + 7 * description.objects.size();
}
std::size_t num_velocities(const RobotDescription& description) noexcept {
  return static_cast<std::size_t>(num_joints(description)) + 6 * description.objects.size();
}

}  // namespace

CompanionDescription scene_companion(const RobotDescription& description) {
  std::vector<FieldDescription> fields;
  for (FieldDescription field : describe<Stamp>().fields()) {
    field.name = "stamp." + field.name;
    fields.push_back(std::move(field));
  }
  std::size_t offset = sizeof(Stamp);
  const auto append = [&](const char* name, std::size_t count) {
    fields.push_back({.name = name,
                      .type = ScalarType::kFloat64,
                      .shape = {count},
                      .unit = "",
                      .offset = offset});
    offset += count * sizeof(double);
  };
  append("position", num_positions(description));
  append("velocity", num_velocities(description));
  return {.name = kSceneCompanion,
          .type = "scene_observation",
          .element = ElementDescription(std::move(fields))};
}

std::size_t configuration_size(const RobotDescription& description) noexcept {
  return num_positions(description) + num_velocities(description);
}

void write_scene(const Stamp& stamp, std::span<const double> position,
                 std::span<const double> velocity, std::byte* element) noexcept {
  std::memcpy(element, &stamp, sizeof(stamp));
  std::memcpy(element + sizeof(stamp), position.data(), position.size_bytes());
  std::memcpy(element + sizeof(stamp) + position.size_bytes(), velocity.data(),
              velocity.size_bytes());
}

}  // namespace trifinger
