// SPDX-License-Identifier: BSD-3-Clause
#include "base/printable.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "trifinger/base/text.hpp"

namespace trifinger {
namespace {

enum class Lines : bool { kShown, kKept };

// The first character of `text`, or its first byte if that is no UTF-8.
std::string_view first_of(std::string_view text) noexcept {
  return text.substr(0, std::max<std::size_t>(utf8_length(text), 1));
}

// Only characters of at most three bytes can be dangerous; the others give 0xffff.
unsigned code_of(std::string_view character) noexcept {
  const auto bits = [character](std::size_t i, unsigned mask) {
    return static_cast<unsigned char>(character[i]) & mask;
  };
  switch (character.size()) {
    case 1:
      return bits(0, 0xffU);
    case 2:
      return bits(0, 0x1fU) << 6U | bits(1, 0x3fU);
    case 3:
      return bits(0, 0x0fU) << 12U | bits(1, 0x3fU) << 6U | bits(2, 0x3fU);
    default:
      return 0xffffU;
  }
}

bool is_dangerous(unsigned code) noexcept {
  // After the control characters: marks of the direction of writing, and separators of lines.
  return code < 0x20U || (code >= 0x7fU && code < 0xa0U) || code == 0x061cU || code == 0x200eU ||
         code == 0x200fU || (code >= 0x2028U && code <= 0x202eU) ||
         (code >= 0x2066U && code <= 0x2069U);
}

void append(std::string& shown, std::string_view character, Lines lines) {
  const unsigned code = code_of(character);
  const bool is_text = utf8_length(character) != 0;
  if ((is_text && !is_dangerous(code)) ||
      (lines == Lines::kKept && (character == "\n" || character == "\t"))) {
    shown += character;
  } else if (character == "\n") {
    shown += "\\n";
  } else if (character == "\t") {
    shown += "\\t";
  } else if (character == "\r") {
    shown += "\\r";
  } else {
    std::array<char, 8> escape{};
    std::snprintf(escape.data(), escape.size(), code < 0x100U ? "\\x%02x" : "\\u%04x", code);
    shown += escape.data();
  }
}

// 3145728 as "3,145,728".
std::string with_commas(std::size_t number) {
  std::string digits = std::to_string(number);
  for (std::size_t at = digits.size(); at > 3;) digits.insert(at -= 3, ",");
  return digits;
}

std::string printed(std::string_view text, std::size_t most, Lines lines) {
  std::size_t count = 0;
  for (std::string_view rest = text; !rest.empty(); ++count) {
    rest.remove_prefix(first_of(rest).size());
  }
  const std::size_t end = most / 4;  // it often says what to do
  const std::size_t beginning = most - end;
  std::string shown;
  for (std::size_t i = 0; !text.empty(); ++i) {
    const std::string_view character = first_of(text);
    text.remove_prefix(character.size());
    if (count <= most || i < beginning || i + end >= count) {
      append(shown, character, lines);
    } else if (i == beginning) {
      shown += "… (" + with_commas(count) + " characters) …";
    }
  }
  return shown;
}

}  // namespace

std::string printable(std::string_view text, std::size_t most) {
  return printed(text, most, Lines::kShown);
}

std::string printable_lines(std::string_view text, std::size_t most) {
  return printed(text, most, Lines::kKept);
}

}  // namespace trifinger
