// SPDX-License-Identifier: BSD-3-Clause
#include "limit_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace trifinger::detail {

std::string number_text(double number) {
  if (std::isinf(number)) return number > 0.0 ? ".inf" : "-.inf";
  std::array<char, 40> digits{};
  const auto [end, problem] = std::to_chars(digits.data(), digits.data() + digits.size(), number);
  return {digits.data(), end};
}

std::string quoted_text(std::string_view text) {
  std::string result = "'";
  for (const char letter : text) result += letter == '\'' ? "''" : std::string(1, letter);
  return result + "'";
}

std::string key_of(std::string_view name) {
  const bool is_plain = !name.empty() && std::ranges::all_of(name, [](char letter) {
    return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
           (letter >= '0' && letter <= '9') || letter == '_';
  });
  return is_plain ? std::string(name) : quoted_text(name);
}

}  // namespace trifinger::detail
