// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

// What writer and reader of logs agree on; docs/log_format.md has the rest.
namespace trifinger::log::detail {

inline constexpr std::int64_t kFormatVersion = 1;
inline constexpr std::string_view kLogSuffix = ".mcap";
// Bytes that every CDR message begins with.
inline constexpr std::size_t kCdrHeaderSize = 4;

}  // namespace trifinger::log::detail
