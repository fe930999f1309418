// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/pixels.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::camera {
namespace {

using trifinger::detail::text_of;

void require_sizes(const ImageFormat& format, std::size_t pixels, std::size_t rgb) {
  const auto count =
      static_cast<std::size_t>(format.width) * static_cast<std::size_t>(format.height);
  detail::require(pixels == format.size() && rgb == 3 * count,
                  text_of("an image of ", format.width, " x ", format.height, " pixels in ",
                          name_of(format.pixels), " has ", format.size(), " bytes and its RGB ",
                          3 * count, "; there are ", pixels, " and ", rgb));
}

// A mosaic with a border: rows and columns beyond it are its mirror images, which have the same
// colours in the same order.
class Mosaic {
 public:
  Mosaic(const ImageFormat& format, std::span<const std::byte> pixels)
      : pixels_(reinterpret_cast<const std::uint8_t*>(pixels.data())),
        width_(format.width),
        height_(format.height) {}

  [[nodiscard]] const std::uint8_t* row(int y) const noexcept {
    return pixels_ + static_cast<std::ptrdiff_t>(mirrored(y, height_)) * width_;
  }
  [[nodiscard]] static int mirrored(int i, int size) noexcept {
    if (size == 1) return 0;
    return i < 0 ? -i : i >= size ? 2 * size - 2 - i : i;
  }

 private:
  const std::uint8_t* pixels_;
  int width_;
  int height_;
};

std::uint8_t mean(int a, int b) noexcept { return static_cast<std::uint8_t>((a + b + 1) / 2); }
std::uint8_t mean(int a, int b, int c, int d) noexcept {
  return static_cast<std::uint8_t>((a + b + c + d + 2) / 4);
}

// The pixel at column x; `left` and `right` are the columns beside it.
template <bool kRedRow, bool kEvenColumn>
void fill(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below, int left,
          int x, int right, std::uint8_t* rgb) noexcept {
  if constexpr (kRedRow != kEvenColumn) {  // a green pixel
    const std::uint8_t in_row = mean(here[left], here[right]);
    const std::uint8_t in_column = mean(above[x], below[x]);
    rgb[0] = kRedRow ? in_row : in_column;
    rgb[1] = here[x];
    rgb[2] = kRedRow ? in_column : in_row;
  } else {
    const std::uint8_t cross = mean(here[left], here[right], above[x], below[x]);
    const std::uint8_t diagonal = mean(above[left], above[right], below[left], below[right]);
    rgb[0] = kRedRow ? here[x] : diagonal;
    rgb[1] = cross;
    rgb[2] = kRedRow ? diagonal : here[x];
  }
}

template <bool kRedRow>
void fill_row(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
              int width, std::uint8_t* rgb) noexcept {
  const auto at_border = [&](int x) {
    const int left = Mosaic::mirrored(x - 1, width);
    const int right = Mosaic::mirrored(x + 1, width);
    if (x % 2 == 0) {
      fill<kRedRow, true>(above, here, below, left, x, right, rgb + std::ptrdiff_t{3} * x);
    } else {
      fill<kRedRow, false>(above, here, below, left, x, right, rgb + std::ptrdiff_t{3} * x);
    }
  };
  at_border(0);
  int x = 1;
  for (; x + 2 < width; x += 2) {
    fill<kRedRow, false>(above, here, below, x - 1, x, x + 1, rgb + std::ptrdiff_t{3} * x);
    fill<kRedRow, true>(above, here, below, x, x + 1, x + 2, rgb + std::ptrdiff_t{3} * (x + 1));
  }
  for (; x < width; ++x) at_border(x);
}

}  // namespace

void to_rgb(const ImageFormat& format, std::span<const std::byte> pixels,
            std::span<std::byte> rgb) {
  require_sizes(format, pixels.size(), rgb.size());
  switch (format.pixels) {
    case PixelFormat::kRgb8:
      std::memcpy(rgb.data(), pixels.data(), pixels.size());
      return;
    case PixelFormat::kMono8:
      for (std::size_t i = 0; i < pixels.size(); ++i) std::fill_n(&rgb[3 * i], 3, pixels[i]);
      return;
    case PixelFormat::kBayerRg8:
      break;
  }
  const Mosaic mosaic(format, pixels);
  auto* const target = reinterpret_cast<std::uint8_t*>(rgb.data());
  for (int y = 0; y < format.height; ++y) {
    std::uint8_t* const row = target + std::ptrdiff_t{3} * y * format.width;
    const auto fill_this = y % 2 == 0 ? fill_row<true> : fill_row<false>;
    fill_this(mosaic.row(y - 1), mosaic.row(y), mosaic.row(y + 1), format.width, row);
  }
}

void from_rgb(std::span<const std::byte> rgb, const ImageFormat& format,
              std::span<std::byte> pixels) {
  require_sizes(format, pixels.size(), rgb.size());
  const auto value = [&rgb](std::size_t pixel, std::size_t channel) {
    return static_cast<unsigned>(rgb[3 * pixel + channel]);
  };
  const auto width = static_cast<std::size_t>(format.width);
  const std::size_t count = width * static_cast<std::size_t>(format.height);
  switch (format.pixels) {
    case PixelFormat::kRgb8:
      std::memcpy(pixels.data(), rgb.data(), rgb.size());
      return;
    case PixelFormat::kMono8:
      // ITU-R BT.601, in 256ths.
      for (std::size_t i = 0; i < count; ++i) {
        pixels[i] = static_cast<std::byte>(
            (77 * value(i, 0) + 150 * value(i, 1) + 29 * value(i, 2) + 128) / 256);
      }
      return;
    case PixelFormat::kBayerRg8:
      for (std::size_t i = 0; i < count; ++i) {
        pixels[i] = rgb[3 * i + (i / width) % 2 + (i % width) % 2];
      }
      return;
  }
}

}  // namespace trifinger::camera
