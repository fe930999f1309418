// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <random>
#include <string>
#include <string_view>

#include "base/text_of.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::log::detail {

// ---- classes of ASCII characters, whatever the locale ----

[[nodiscard]] constexpr bool is_lower(char c) noexcept { return c >= 'a' && c <= 'z'; }
[[nodiscard]] constexpr bool is_upper(char c) noexcept { return c >= 'A' && c <= 'Z'; }
[[nodiscard]] constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

// ---- times and names ----

[[nodiscard]] inline Instant now() noexcept { return std::chrono::steady_clock::now(); }

// Returns the time of the wall clock since 1970 [ns].
[[nodiscard]] inline std::int64_t wall_time() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// The time of the wall clock since 1970 [s].
[[nodiscard]] inline std::time_t wall_seconds() noexcept {
  return std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
}

// Formats a time since 1970 [s] as in the names of logs: "2026-11-20_09-05-12", UTC. Sorts in the
// order of time.
[[nodiscard]] inline std::string date_text(std::time_t time) {
  return trifinger::detail::utc_text(time, "%Y-%m-%d_%H-%M-%S");
}

inline constexpr std::string_view kDatePattern = "0000-00-00_00-00-00";

// True if the text has the format of `date_text`.
[[nodiscard]] constexpr bool is_date(std::string_view text) noexcept {
  return std::ranges::equal(text, kDatePattern, [](char c, char wanted) {
    return wanted == '0' ? is_digit(c) : c == wanted;
  });
}

// Returns the date in the name of a log, such as "sim_2026-11-20_09-05-12_000.mcap"; empty if there
// is none.
[[nodiscard]] constexpr std::string_view date_in(std::string_view name) noexcept {
  for (std::size_t i = name.size(); i-- > 1;) {
    const std::string_view text = name.substr(i, kDatePattern.size());
    if (name[i - 1] == '_' && is_date(text)) return text;
  }
  return {};
}

// Returns 64 random bits in hexadecimal. They tell one recording from all others.
[[nodiscard]] inline std::string random_id() {
  std::random_device random;
  std::string id;
  for (int i = 0; i < 16; ++i) id += "0123456789abcdef"[random() % 16];
  return id;
}

}  // namespace trifinger::log::detail
