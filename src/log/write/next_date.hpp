// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

namespace trifinger::log::detail {

/// Returns the date for the name of a log that begins now in `folder`: the present one, or a second
/// after the newest one in the folder if that is not earlier. So names tell in which order logs
/// began, even if the clock was set back.
[[nodiscard]] std::string next_date(const std::filesystem::path& folder);

}  // namespace trifinger::log::detail
