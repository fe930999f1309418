// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace trifinger {

/// Number of characters of a text that `printable` keeps.
inline constexpr std::size_t kMaxPrinted = 1000;

/// Returns a text of others, such as a name in a file, as it may be printed.
///
/// A terminal obeys control characters, and some characters turn the order of others around. They
/// are shown like "\x1b" and "\u202e", and bytes that are no UTF-8 like "\xff". The middle of a
/// text with more than `most` characters is left out, and its length is said.
///
/// `printable` in python/trifinger/text.py gives the same.
[[nodiscard]] std::string printable(std::string_view text, std::size_t most = kMaxPrinted);

/// The same for a text of several lines, such as an error: ends of lines and tabs remain.
[[nodiscard]] std::string printable_lines(std::string_view text,
                                          std::size_t most = 4 * kMaxPrinted);

}  // namespace trifinger
