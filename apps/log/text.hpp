// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "trifinger/log/log.hpp"

// Texts that several commands of `trifinger log` use.
namespace trifinger::apps {

// Formats a size: "812 bytes", "24.6 MB".
[[nodiscard]] std::string size_text(std::uint64_t bytes);
// Formats a date: "2026-11-20 09:57:35 UTC"; `time` since 1970 [ns].
[[nodiscard]] std::string date_text(std::int64_t time);
// Formats a damage: "bytes 4711 to 4999: The checksum of a chunk is wrong". Names the file if there
// are several.
[[nodiscard]] std::string text_of(const log::Damage& damage);

}  // namespace trifinger::apps
