// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace trifinger {

/// Number of bytes of the first UTF-8 character of `text`; 0 if `text` does not begin with one.
[[nodiscard]] std::size_t utf8_length(std::string_view text) noexcept;

/// True if `text` is valid UTF-8.
[[nodiscard]] bool is_utf8(std::string_view text) noexcept;

/// Formats a size: "812 bytes", "24.6 MB".
[[nodiscard]] std::string size_text(std::uint64_t bytes);

/// The name of the enumerator `value` in `names`, which begins with that of 0; otherwise "unknown".
template <class Enum, std::size_t N>
[[nodiscard]] constexpr std::string_view name_in(const std::array<std::string_view, N>& names,
                                                 Enum value) noexcept {
  const auto i = static_cast<std::size_t>(value);
  return i < N ? names[i] : "unknown";
}

/// A sentence with its own fixed memory, for code that must not use the heap, such as a driver in
/// the loop.
///
/// The text is always one line of UTF-8. Control characters become spaces, and invalid bytes become
/// question marks. A text that is too long is cut off and ends in "...".
class FixedText {
 public:
  static constexpr std::size_t kCapacity = 255;  ///< [bytes]; a session keeps as much of a fault.

  FixedText() = default;
  explicit FixedText(std::string_view text) noexcept { append(text); }

  FixedText& append(std::string_view text) noexcept;
  /// Appends the shortest decimal number that reads back as `number`.
  FixedText& append(double number) noexcept;
  FixedText& append(std::size_t number) noexcept;
  /// Appends "threw an exception: " and the text of the exception. Works only in a catch block.
  FixedText& append_exception() noexcept;

  /// The view is valid until the text changes.
  [[nodiscard]] std::string_view view() const noexcept { return {text_.data(), size_}; }

 private:
  void cut() noexcept;

  std::array<char, kCapacity> text_{};
  std::size_t size_{0};
  bool is_cut_{false};
};

}  // namespace trifinger
