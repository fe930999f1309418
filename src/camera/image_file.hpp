// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/camera/camera.hpp"

namespace trifinger::camera {

/// An image with its size: RGB or brightness.
struct Picture {
  ImageFormat format{};
  std::vector<std::byte> pixels;
};

/// The bytes of a PNG file. A Bayer mosaic becomes a grey image, from which it can be read again.
/// @throws InvalidArgument if the size is wrong
[[nodiscard]] std::string encode_png(const ImageFormat& format, std::span<const std::byte> pixels);

/// The bytes of a JPEG file; a Bayer mosaic becomes RGB first. `quality` is 1 to 100.
/// @throws InvalidArgument, Error that says what to install if the library is missing
[[nodiscard]] std::string encode_jpeg(const ImageFormat& format, std::span<const std::byte> pixels,
                                      int quality = 90);

/// @throws Error that says what to install if the library for JPEG is missing
void require_jpeg();

/// Reads a PNG or JPEG file. Transparency is left out, palettes become RGB.
/// @throws InvalidArgument that says what is wrong with the file, Error that says what to install
/// if the library for JPEG is missing
[[nodiscard]] Picture decode_image(std::string_view file);

/// The picture in another format: the mosaic of an RGB picture, RGB of a grey one. A grey picture
/// counts as a mosaic already, since `encode_png` writes mosaics so.
/// @throws InvalidArgument if its size is not that of the format
[[nodiscard]] std::vector<std::byte> converted(const Picture& picture, const ImageFormat& format);

}  // namespace trifinger::camera
