// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace trifinger {

/// How many bytes the character at the beginning of `text` has in UTF-8; 0 if there is none.
[[nodiscard]] std::size_t utf8_length(std::string_view text) noexcept;

/// True if all of `text` is UTF-8.
[[nodiscard]] bool is_utf8(std::string_view text) noexcept;

/// A sentence in memory of its own, for code that may take none from the heap: what a driver says
/// in the loop.
///
/// It is always one line of UTF-8, whatever is appended: control characters become spaces, bytes
/// that are no UTF-8 question marks. A text that is too long is cut off, and then ends in "...".
class FixedText {
 public:
  static constexpr std::size_t kCapacity = 255;  ///< Bytes; a session keeps as many of a fault.

  FixedText() = default;
  explicit FixedText(std::string_view text) noexcept { append(text); }

  FixedText& append(std::string_view text) noexcept;
  /// Appends the shortest decimal number that reads as `number` again.
  FixedText& append(double number) noexcept;
  FixedText& append(std::size_t number) noexcept;
  /// In a catch block only: appends "threw an exception: " and its text.
  FixedText& append_exception() noexcept;

  /// Holds until the text changes.
  [[nodiscard]] std::string_view view() const noexcept { return {text_.data(), size_}; }

 private:
  void cut() noexcept;

  std::array<char, kCapacity> text_{};
  std::size_t size_{0};
  bool is_cut_{false};
};

}  // namespace trifinger
