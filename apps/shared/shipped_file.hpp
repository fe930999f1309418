// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/core.h>

#include <filesystem>
#include <string>

#include "base/regular_file.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {

// Reads a file that is installed in a `folder` beside the configurations. Throws Error.
[[nodiscard]] inline std::string read_shipped_file(const std::string& folder,
                                                   const std::string& name) {
  constexpr std::size_t kMaxSize = 1U << 20U;
  for (const std::filesystem::path& place : config_folders(folder)) {
    if (exists(place / name)) return read_file(place / name, kMaxSize);
  }
  throw Error(fmt::format("the file {}/{} is missing in this installation", folder, name));
}

}  // namespace trifinger::apps
