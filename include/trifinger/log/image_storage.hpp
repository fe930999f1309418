// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace trifinger::log {

/// What a log keeps of the images of a robot's cameras. The companion with their numbers, times,
/// exposures and states is always recorded.
enum class ImageStorage : std::uint8_t {
  kNone,  ///< No pixels.
  kJpeg,  ///< JPEG in colour. What viewers show; some twentieth of the pixels' size.
  kRaw,   ///< The pixels as the camera delivers them, such as a Bayer mosaic; bit for bit.
};

}  // namespace trifinger::log
