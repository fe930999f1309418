// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/mcap/records.hpp"

namespace trifinger::mcap {

std::string_view name_of(Compression compression) noexcept {
  switch (compression) {
    case Compression::kNone:
      return "";
    case Compression::kLz4:
      return "lz4";
    case Compression::kZstd:
      return "zstd";
  }
  return "";
}

}  // namespace trifinger::mcap
