// SPDX-License-Identifier: BSD-3-Clause
#include "log_text.hpp"

#include <fmt/chrono.h>
#include <fmt/core.h>

#include <algorithm>
#include <ctime>

#include "trifinger/base/error.hpp"

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

std::vector<std::filesystem::path> files_of(const std::string& path) {
  if (!std::filesystem::is_directory(path)) return {path};
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    if (entry.path().extension() == ".mcap") files.push_back(entry.path());
  }
  if (files.empty()) throw InvalidArgument("the folder " + path + " has no .mcap files");
  std::ranges::sort(files);
  return files;
}

}  // namespace trifinger::apps
