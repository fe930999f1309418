// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string_view>

namespace trifinger::manipulation {

// A letter of single strokes in a frame whose unit is the height of capitals: x to the right, y up,
// the origin on the line of writing. Its path is written as in SVG: M begins a stroke at a point, L
// goes straight to a point, C goes to the last of three points on Bezier's curve.
struct Letter {
  char sign;
  double width;
  std::string_view path;
};

[[nodiscard]] std::span<const Letter> all_letters() noexcept;

}  // namespace trifinger::manipulation
