// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "trifinger/base/random.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger {

/// The state in which a robot is: how far its joints, motors, encoders and tips are from what its
/// description says. docs/simulation.md has the figures, and their sources.
enum class Condition : std::uint8_t {
  kAsDocumented,  ///< Joints are perfect.
  kAsBuilt,       ///< A robot that was built and homed with care.
  kWorn,          ///< Twice as bad, with tips that are smoother and softer or harder.
};

/// Names of all conditions, in the order of `Condition`.
inline constexpr std::array<std::string_view, 3> kConditionNames{"as documented", "as built",
                                                                 "worn"};

[[nodiscard]] constexpr std::string_view name_of(Condition condition) noexcept {
  return kConditionNames[static_cast<std::size_t>(condition)];
}
/// @throws InvalidArgument with the names
[[nodiscard]] Condition condition_from_name(std::string_view name);

/// Draws a robot in this condition. Masses, and the friction of other surfaces, are as described.
[[nodiscard]] Variation draw(Condition condition, Random& random) noexcept;

/// Sets the number of this name, as in `set_value(robot, "backlash", 0.004)`; steps are rounded.
/// @throws InvalidArgument with the names
void set_value(Variation& robot, std::string_view name, double value);

}  // namespace trifinger
