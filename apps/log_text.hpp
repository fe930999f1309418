// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "trifinger/log/log.hpp"

// What the commands of `trifinger log` say alike.
namespace trifinger::apps {

// "812 bytes", "24.6 MB".
[[nodiscard]] std::string size_text(std::uint64_t bytes);
// "2026-11-20 09:57:35 UTC"; `time` since 1970 [ns].
[[nodiscard]] std::string date_text(std::int64_t time);
// "bytes 4711 to 4999: The checksum of a chunk is wrong", with the file if there are several.
[[nodiscard]] std::string text_of(const log::Damage& damage);

}  // namespace trifinger::apps
