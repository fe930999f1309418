// SPDX-License-Identifier: BSD-3-Clause
#include "camera/image_file.hpp"

#include "base/text_of.hpp"
#include "png.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/pixels.hpp"
#include "turbojpeg.hpp"

namespace trifinger::camera {
namespace {

using trifinger::detail::text_of;

void require_size(const ImageFormat& format, std::span<const std::byte> pixels) {
  detail::require(
      pixels.size() == format.size(),
      text_of("an image of ", format.width, " x ", format.height, " pixels in ",
              name_of(format.pixels), " has ", format.size(), " bytes, these are ", pixels.size()));
}

std::vector<std::byte> rgb_of(const ImageFormat& format, std::span<const std::byte> pixels) {
  std::vector<std::byte> rgb(3 * static_cast<std::size_t>(format.width) *
                             static_cast<std::size_t>(format.height));
  to_rgb(format, pixels, rgb);
  return rgb;
}

}  // namespace

std::string encode_png(const ImageFormat& format, std::span<const std::byte> pixels) {
  require_size(format, pixels);
  return compress_png(format, pixels);
}

std::string encode_jpeg(const ImageFormat& format, std::span<const std::byte> pixels, int quality) {
  require_size(format, pixels);
  detail::require(quality >= 1 && quality <= 100,
                  text_of("the quality of JPEG is ", quality, ", must be 1 to 100"));
  if (format.pixels != PixelFormat::kBayerRg8) return compress_jpeg(format, pixels, quality);
  const ImageFormat colour{
      .width = format.width, .height = format.height, .pixels = PixelFormat::kRgb8};
  // New memory for each image would take longer than its colours.
  thread_local std::vector<std::byte> rgb;
  rgb.resize(colour.size());
  to_rgb(format, pixels, rgb);
  return compress_jpeg(colour, rgb, quality);
}

void require_jpeg() { require_turbojpeg(); }

Picture decode_image(std::string_view file) {
  if (file.starts_with("\x89PNG\r\n\x1a\n")) return decompress_png(file);
  if (file.starts_with("\xff\xd8")) return decompress_jpeg(file);
  throw InvalidArgument("the file is neither a PNG nor a JPEG image");
}

std::vector<std::byte> converted(const Picture& picture, const ImageFormat& format) {
  const ImageFormat& own = picture.format;
  detail::require(own.width == format.width && own.height == format.height,
                  text_of("the image has ", own.width, " x ", own.height, " pixels, must have ",
                          format.width, " x ", format.height));
  const bool is_mosaic =
      own.pixels == PixelFormat::kMono8 && format.pixels == PixelFormat::kBayerRg8;
  if (own == format || is_mosaic) return picture.pixels;
  std::vector<std::byte> pixels(format.size());
  from_rgb(rgb_of(own, picture.pixels), format, pixels);
  return pixels;
}

}  // namespace trifinger::camera
