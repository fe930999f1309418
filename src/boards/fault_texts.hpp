// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "boards/board.hpp"
#include "boards/homing.hpp"

namespace trifinger::boards {

struct FaultText {
  std::string_view sentence;  // after the name of the board
  std::string_view remedy;
};

// Describes a fault, except for kError, which the board describes.
[[nodiscard]] FaultText text_of(BoardFault fault) noexcept;

// What follows the name of a joint.
[[nodiscard]] std::string_view text_of(JointHoming::Failure failure) noexcept;

}  // namespace trifinger::boards
