// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "camera/image_file.hpp"

namespace trifinger::camera {

// Throws Error that says what to install if libturbojpeg cannot be loaded.
void require_turbojpeg();
// Compresses RGB or brightness. Throws Error, also if libturbojpeg cannot be loaded.
[[nodiscard]] std::string compress_jpeg(const ImageFormat& format,
                                        std::span<const std::byte> pixels, int quality);
// Throws InvalidArgument for a file that is damaged, Error if libturbojpeg cannot be loaded.
[[nodiscard]] Picture decompress_jpeg(std::string_view file);
// The same into memory of the caller, which must have the size of `format`, RGB or brightness.
void decompress_jpeg(std::string_view file, const ImageFormat& format, std::span<std::byte> pixels);

}  // namespace trifinger::camera
