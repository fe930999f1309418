// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "trifinger/base/time.hpp"

// Quantities as they are typed behind an option. All throw UsageError that names the option.
namespace trifinger::apps {

// "500MB", "2GiB", "1e6": a number of bytes.
[[nodiscard]] std::uint64_t parse_size(const std::string& option, const std::string& text);
// "30s", "10min", "1h", "2d", "500ms".
[[nodiscard]] Nanoseconds parse_duration(const std::string& option, const std::string& text);

}  // namespace trifinger::apps
