// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/object_observation.hpp"

#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/model/scene_model.hpp"

namespace trifinger {

namespace {

template <class Objects>
std::optional<CompanionDescription> companion_of(const Objects& objects) {
  std::vector<std::string> names;
  names.reserve(objects.size());
  for (const auto& object : objects) names.push_back(object.name);
  return object_companion(names);
}

}  // namespace

std::optional<CompanionDescription> object_companion(std::span<const ObjectDescription> objects) {
  return companion_of(objects);
}

std::optional<CompanionDescription> object_companion(const SceneModel& model) {
  return companion_of(model.objects());
}

std::optional<CompanionDescription> object_companion(std::span<const std::string> names) {
  if (names.empty()) return std::nullopt;
  std::vector<FieldDescription> fields;
  std::size_t offset = 0;
  const auto append = [&](const std::string& prefix, const ElementDescription& element) {
    for (FieldDescription field : element.fields()) {
      field.name = prefix + field.name;
      field.offset += offset;
      fields.push_back(std::move(field));
    }
    offset += element.size();
  };
  append("stamp.", describe<Stamp>());
  for (const std::string& name : names) append(name + ".", describe<ObjectPose>());
  return CompanionDescription{.name = kObjectCompanion,
                              .type = "object_observation",
                              .element = ElementDescription(std::move(fields))};
}

void write_objects(const Stamp& stamp, std::span<const ObjectPose> objects,
                   std::byte* element) noexcept {
  std::memcpy(element, &stamp, sizeof(stamp));
  std::memcpy(element + sizeof(stamp), objects.data(), objects.size_bytes());
}

}  // namespace trifinger
