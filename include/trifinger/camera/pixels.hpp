// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>

#include "trifinger/camera/camera.hpp"

namespace trifinger::camera {

/// Makes RGB of an image in any format: 3 bytes per pixel, of the same size. The two colours that a
/// pixel of a Bayer mosaic lacks are the mean of its nearest neighbours; grey stays grey.
/// @throws InvalidArgument if a size is wrong
void to_rgb(const ImageFormat& format, std::span<const std::byte> pixels, std::span<std::byte> rgb);

/// Makes an image in any format from RGB; a Bayer mosaic keeps one colour of each pixel.
/// @throws InvalidArgument if a size is wrong
void from_rgb(std::span<const std::byte> rgb, const ImageFormat& format,
              std::span<std::byte> pixels);

}  // namespace trifinger::camera
