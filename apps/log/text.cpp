// SPDX-License-Identifier: BSD-3-Clause
#include "log/text.hpp"

#include <fmt/chrono.h>
#include <fmt/core.h>

#include <ctime>

namespace trifinger::apps {

std::string size_text(std::uint64_t bytes) {
  const auto size = static_cast<double>(bytes);
  if (bytes == 1) return "1 byte";
  if (size < 1e3) return fmt::format("{} bytes", bytes);
  if (size < 999.5e3) return fmt::format("{:.3g} kB", size / 1e3);
  if (size < 999.5e6) return fmt::format("{:.3g} MB", size / 1e6);
  return fmt::format("{:.3g} GB", size / 1e9);
}

std::string date_text(std::int64_t time) {
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC",
                     fmt::gmtime(static_cast<std::time_t>(time / 1'000'000'000)));
}

std::string text_of(const log::Damage& damage) {
  if (damage.size == 0) return damage.reason;
  return fmt::format("bytes {} to {}: {}", damage.offset, damage.offset + damage.size - 1,
                     damage.reason);
}

}  // namespace trifinger::apps
