// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string_view>

namespace trifinger::log {

/// What a log keeps of the images of a robot's cameras. The companion with their numbers, times,
/// exposures and states is always recorded.
enum class ImageStorage : std::uint8_t {
  kNone,  ///< No pixels.
  kJpeg,  ///< JPEG in colour. What viewers show; some twentieth of the pixels' size.
  kRaw,   ///< The pixels as the camera delivers them, such as a Bayer mosaic; bit for bit.
};

/// "none", "jpeg", "raw"
[[nodiscard]] constexpr std::string_view name_of(ImageStorage storage) noexcept {
  switch (storage) {
    case ImageStorage::kNone:
      return "none";
    case ImageStorage::kJpeg:
      return "jpeg";
    case ImageStorage::kRaw:
      return "raw";
  }
  return "";
}

}  // namespace trifinger::log
