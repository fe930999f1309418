// SPDX-License-Identifier: BSD-3-Clause
#include "log/write/next_date.hpp"

#include <algorithm>
#include <charconv>
#include <ctime>
#include <string_view>
#include <system_error>

#include "log/format/format.hpp"
#include "log/format/text.hpp"

namespace trifinger::log::detail {
namespace {

// Returns the second after a date that `date_text` has written.
std::string second_after(std::string_view date) {
  const auto number = [date](std::size_t begin, std::size_t size) {
    int value = 0;
    std::from_chars(date.data() + begin, date.data() + begin + size, value);
    return value;
  };
  std::tm parts{};
  parts.tm_year = number(0, 4) - 1900;
  parts.tm_mon = number(5, 2) - 1;
  parts.tm_mday = number(8, 2);
  parts.tm_hour = number(11, 2);
  parts.tm_min = number(14, 2);
  parts.tm_sec = number(17, 2);
  return date_text(::timegm(&parts) + 1);
}

}  // namespace

std::string next_date(const std::filesystem::path& folder) {
  std::string next = date_text(wall_seconds());
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    if (entry.path().extension() != kLogSuffix) continue;
    const std::string name = entry.path().stem().string();
    const std::string_view date = date_in(name);
    if (date.empty() || date < next) continue;
    // Whoever has named a file may have chosen a date that no later one follows.
    if (std::string later = second_after(date); is_date(later)) next = std::max(next, later);
  }
  return next;
}

}  // namespace trifinger::log::detail
