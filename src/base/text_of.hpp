// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <ctime>
#include <functional>
#include <sstream>
#include <string>

namespace trifinger::detail {

// Joins all parts. Numbers are written as people write them: "0.001", not "0.001000".
template <class... Parts>
[[nodiscard]] std::string text_of(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  return text.str();
}

// The texts of all parts, with commas between them. `text_of_part` may also be a member of a part.
template <class Parts, class Text = std::identity>
[[nodiscard]] std::string joined(const Parts& parts, const Text& text_of_part = {}) {
  std::string text;
  for (const auto& part : parts) {
    text.append(text.empty() ? "" : ", ").append(std::invoke(text_of_part, part));
  }
  return text;
}

// Formats a time since 1970 [s] with a format string of `strftime`.
[[nodiscard]] inline std::string utc_text(std::time_t time, const char* format) {
  std::tm date{};
  ::gmtime_r(&time, &date);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), format, &date);
  return text.data();
}

}  // namespace trifinger::detail
