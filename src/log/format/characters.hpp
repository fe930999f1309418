// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Classes of ASCII characters, whatever the locale.
namespace trifinger::log {

[[nodiscard]] constexpr bool is_lower(char c) noexcept { return c >= 'a' && c <= 'z'; }
[[nodiscard]] constexpr bool is_upper(char c) noexcept { return c >= 'A' && c <= 'Z'; }
[[nodiscard]] constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

}  // namespace trifinger::log
