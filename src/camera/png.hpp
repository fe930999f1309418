// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "camera/image_file.hpp"

namespace trifinger::camera {

// Compresses RGB or brightness.
[[nodiscard]] std::string compress_png(const ImageFormat& format,
                                       std::span<const std::byte> pixels);
// Throws InvalidArgument for a file that is damaged or of a kind that cameras do not write.
[[nodiscard]] Picture decompress_png(std::string_view file);

}  // namespace trifinger::camera
