// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <charconv>
#include <string>

namespace trifinger::manipulation {

// A number with so many digits after the point.
[[nodiscard]] inline std::string decimal(double number, int digits) {
  std::array<char, 64> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), number,
                                    std::chars_format::fixed, digits);
  return {text.data(), result.ptr};
}

}  // namespace trifinger::manipulation
