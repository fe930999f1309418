// SPDX-License-Identifier: BSD-3-Clause
#include "read_object.hpp"

#include <array>
#include <cstddef>
#include <string>

namespace trifinger::detail {

using config::Node;
using config::Range;

ObjectDescription read_object(const Node& node) {
  const Range length{.unit = "m", .min = 0.005, .max = 0.3};
  const auto name = node.required<std::string>("name");
  const auto type = node.required_choice<ObjectDescription (*)(std::string)>(
      "type", {{"cube", cube}, {"cuboid", cuboid}, {"stick", stick}, {"ball", ball}});
  ObjectDescription object = type(name);
  if (const auto size = node.find("size")) {
    const auto lengths = size->as<std::vector<double>>(length);
    const std::size_t expected = type == cuboid ? 3 : type == stick ? 2 : 1;
    if (lengths.size() != expected) {
      size->fail("has " + std::to_string(lengths.size()) + " lengths, must have " +
                 std::to_string(expected));
    }
    for (std::size_t i = 0; i < object.size.size(); ++i) {
      // A cube has one edge length for all axes; a ball uses only the first number.
      object.size[i] = i < expected ? lengths[i] : type == cube ? lengths[0] : 0.0;
    }
  }
  object.mass = node.optional<double>("mass", object.mass, {.unit = "kg", .min = 0.001, .max = 2});
  if (const auto position = node.find("position")) {
    object.position = position->as<Triple>({.unit = "m", .min = -2, .max = 2});
  }
  object.orientation = node.optional<std::array<double, 4>>("orientation", object.orientation,
                                                            {.min = -10, .max = 10});
  object.velocity =
      node.optional<Triple>("velocity", object.velocity, {.unit = "m/s", .min = -10, .max = 10});
  object.angular_velocity = node.optional<Triple>("angular_velocity", object.angular_velocity,
                                                  {.unit = "rad/s", .min = -100, .max = 100});
  if (const auto colours = node.find("colours")) {
    if (object.shape != ObjectShape::kBox) colours->fail("is for a cube or a cuboid");
    object.colours = colours->as<BoxColours>();
  }
  return object;
}

std::vector<ObjectDescription> read_objects(const Node& objects) {
  std::vector<ObjectDescription> read;
  for (const Node& object : objects.items()) read.push_back(read_object(object));
  return read;
}

}  // namespace trifinger::detail
