// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/text.hpp"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <exception>

namespace trifinger {
namespace {

bool is_continuation(char byte) noexcept {
  return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80U;
}

// True for control characters: a terminal might interpret them as commands.
bool is_control(std::string_view character) noexcept {
  const auto first = static_cast<unsigned char>(character[0]);
  if (character.size() == 1) return first < 0x20U || first == 0x7FU;
  return first == 0xC2U && static_cast<unsigned char>(character[1]) < 0xA0U;
}

}  // namespace

// Unicode, Table 3-7: surrogates and overlong forms are invalid.
std::size_t utf8_length(std::string_view text) noexcept {
  if (text.empty()) return 0;
  const auto at = [&](std::size_t k) {
    return k < text.size() ? static_cast<unsigned char>(text[k]) : 0U;
  };
  const unsigned first = at(0);
  const unsigned second = at(1);
  std::size_t length = 0;
  bool is_right = true;
  if (first < 0x80U) {
    length = 1;
  } else if (first >= 0xC2U && first <= 0xDFU) {
    length = 2;
  } else if (first >= 0xE0U && first <= 0xEFU) {
    length = 3;
    is_right = (first != 0xE0U || second >= 0xA0U) && (first != 0xEDU || second <= 0x9FU);
  } else if (first >= 0xF0U && first <= 0xF4U) {
    length = 4;
    is_right = (first != 0xF0U || second >= 0x90U) && (first != 0xF4U || second <= 0x8FU);
  } else {
    return 0;
  }
  for (std::size_t k = 1; k < length; ++k) {
    is_right = is_right && is_continuation(static_cast<char>(at(k)));
  }
  return is_right ? length : 0;
}

bool is_utf8(std::string_view text) noexcept {
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string size_text(std::uint64_t bytes) {
  if (bytes == 1) return "1 byte";
  constexpr std::array<const char*, 5> kUnits{"bytes", "kB", "MB", "GB", "TB"};
  auto size = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (size >= 999.5 && unit + 1 < kUnits.size()) {
    size /= 1000.0;
    ++unit;
  }
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g %s", size, kUnits[unit]);
  return text.data();
}

FixedText& FixedText::append(std::string_view text) noexcept {
  while (!text.empty() && !is_cut_) {
    const std::size_t length = std::max<std::size_t>(utf8_length(text), 1);
    std::string_view character = text.substr(0, length);
    text.remove_prefix(length);
    if (utf8_length(character) == 0) {
      character = "?";
    } else if (is_control(character)) {
      character = " ";
    }
    if (size_ + character.size() > kCapacity) {
      cut();
    } else {
      size_ += character.copy(text_.data() + size_, character.size());
    }
  }
  return *this;
}

FixedText& FixedText::append(double number) noexcept {
  std::array<char, 32> digits{};
  const auto result = std::to_chars(digits.begin(), digits.end(), number);
  return append(std::string_view(digits.begin(), result.ptr));
}

FixedText& FixedText::append(std::size_t number) noexcept {
  std::array<char, 32> digits{};
  const auto result = std::to_chars(digits.begin(), digits.end(), number);
  return append(std::string_view(digits.begin(), result.ptr));
}

FixedText& FixedText::append_exception() noexcept {
  try {
    throw;
  } catch (const std::exception& error) {
    const char* const what = error.what();
    const std::string_view text = what == nullptr ? "" : what;
    return text.empty() ? append("threw an exception without a text")
                        : append("threw an exception: ").append(text);
  } catch (...) {
    return append("threw an object that is no std::exception, so there is no text");
  }
}

void FixedText::cut() noexcept {
  constexpr std::string_view kMark = "...";
  size_ = std::min(size_, kCapacity - kMark.size());
  // Never cut a character in half.
  while (size_ > 0 && is_continuation(text_.at(size_))) --size_;
  size_ += kMark.copy(text_.data() + size_, kMark.size());
  is_cut_ = true;
}

}  // namespace trifinger
