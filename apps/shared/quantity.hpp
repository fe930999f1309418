// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "trifinger/base/time.hpp"

// Quantities typed as values of options. All functions throw UsageError, which names the option.
namespace trifinger::apps {

// Parses a number of bytes: "500MB", "2GiB", "1e6".
[[nodiscard]] std::uint64_t parse_size(const std::string& option, const std::string& text);
// Parses a duration: "30s", "10min", "1h", "2d", "500ms".
[[nodiscard]] Nanoseconds parse_duration(const std::string& option, const std::string& text);

}  // namespace trifinger::apps
