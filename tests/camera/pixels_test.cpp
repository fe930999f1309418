// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/pixels.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <tuple>
#include <vector>

#include "camera/image_file.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"

namespace trifinger::test {
namespace {

using camera::ImageFormat;
using camera::PixelFormat;
using ::testing::HasSubstr;

using Pixels = std::vector<std::byte>;

// A smooth picture in colour, such as lenses make.
Pixels smooth_rgb(int width, int height) {
  Pixels rgb;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        rgb.push_back(static_cast<std::byte>(
            std::lround(127.5 + 100 * std::sin(0.05 * (x + 1) * (c + 1)) * std::cos(0.04 * y))));
      }
    }
  }
  return rgb;
}

Pixels random_pixels(std::size_t size, std::uint64_t seed) {
  Random random{.seed = seed};
  Pixels pixels(size);
  for (std::byte& pixel : pixels) pixel = static_cast<std::byte>(random.integer(0, 256));
  return pixels;
}

int largest_difference(const Pixels& a, const Pixels& b) {
  int largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<int>(a[i]) - static_cast<int>(b[i])));
  }
  return largest;
}

TEST(Pixels, OfAMosaicKeepTheColourThatWasMeasured) {
  for (const auto& [width, height] :
       {std::pair{2, 2}, {3, 5}, {16, 16}, {17, 4}, {1, 1}, {1, 7}, {540, 540}}) {
    const ImageFormat bayer{.width = width, .height = height, .pixels = PixelFormat::kBayerRg8};
    const Pixels mosaic = random_pixels(bayer.size(), 1);
    Pixels rgb(3 * bayer.size());
    camera::to_rgb(bayer, mosaic, rgb);
    Pixels again(bayer.size());
    camera::from_rgb(rgb, bayer, again);
    EXPECT_EQ(again, mosaic) << width << " x " << height;
  }
}

TEST(Pixels, OfAMosaicGiveBackUniformColours) {
  const ImageFormat bayer{.width = 9, .height = 8, .pixels = PixelFormat::kBayerRg8};
  Pixels rgb;
  for (std::size_t i = 0; i < bayer.size(); ++i) {
    for (const int value : {200, 30, 90}) rgb.push_back(static_cast<std::byte>(value));
  }
  Pixels mosaic(bayer.size());
  camera::from_rgb(rgb, bayer, mosaic);
  EXPECT_EQ(static_cast<int>(mosaic[0]), 200);  // the first row begins R G
  EXPECT_EQ(static_cast<int>(mosaic[1]), 30);
  EXPECT_EQ(static_cast<int>(mosaic[10]), 90);  // the second one G B
  Pixels again(rgb.size());
  camera::to_rgb(bayer, mosaic, again);
  EXPECT_EQ(again, rgb);
}

TEST(Pixels, OfAMosaicAreNearTheColoursOfASmoothPicture) {
  const ImageFormat bayer{.width = 120, .height = 90, .pixels = PixelFormat::kBayerRg8};
  const Pixels rgb = smooth_rgb(120, 90);
  Pixels mosaic(bayer.size());
  camera::from_rgb(rgb, bayer, mosaic);
  Pixels again(rgb.size());
  camera::to_rgb(bayer, mosaic, again);
  // Linear interpolation of the steepest wave: 100 * 0.15^2 / 2, both ways, and rounding.
  EXPECT_LE(largest_difference(rgb, again), 16);
}

TEST(Pixels, OfAWrongSizeAreRefused) {
  const ImageFormat bayer{.width = 4, .height = 4, .pixels = PixelFormat::kBayerRg8};
  Pixels mosaic(16);
  Pixels rgb(47);
  EXPECT_EQ(message_of<InvalidArgument>([&] { camera::to_rgb(bayer, mosaic, rgb); }),
            "an image of 4 x 4 pixels in bayer_rggb8 has 16 bytes and its RGB 48; there are 16 and "
            "47");
}

TEST(Png, GivesBackEveryPixel) {
  for (const PixelFormat pixels :
       {PixelFormat::kMono8, PixelFormat::kRgb8, PixelFormat::kBayerRg8}) {
    for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {270, 270}}) {
      const ImageFormat format{.width = width, .height = height, .pixels = pixels};
      const Pixels image = random_pixels(format.size(), 2);
      const camera::Picture picture = camera::decode_image(camera::encode_png(format, image));
      EXPECT_EQ(picture.pixels, image);
      EXPECT_EQ(picture.format.width, width);
      EXPECT_EQ(camera::converted(picture, format), image);
    }
  }
}

TEST(Png, ThatIsDamagedIsRefusedWithASentence) {
  const ImageFormat format{.width = 20, .height = 10, .pixels = PixelFormat::kRgb8};
  const std::string file = camera::encode_png(format, random_pixels(format.size(), 3));
  for (std::size_t size = 0; size < file.size(); ++size) {
    EXPECT_THROW(static_cast<void>(camera::decode_image(file.substr(0, size))), InvalidArgument);
  }
  for (std::size_t i = 0; i < file.size(); ++i) {
    std::string damaged = file;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    EXPECT_THROW(static_cast<void>(camera::decode_image(damaged)), InvalidArgument) << i;
  }
  EXPECT_EQ(message_of<InvalidArgument>([] { static_cast<void>(camera::decode_image("hello")); }),
            "the file is neither a PNG nor a JPEG image");
}

TEST(Jpeg, IsNearTheImage) {
  const ImageFormat format{.width = 200, .height = 120, .pixels = PixelFormat::kRgb8};
  const Pixels rgb = smooth_rgb(200, 120);
  const std::string file = camera::encode_jpeg(format, rgb, 95);
  EXPECT_LT(file.size(), rgb.size() / 4);
  const camera::Picture picture = camera::decode_image(file);
  EXPECT_EQ(picture.format, format);
  EXPECT_LE(largest_difference(picture.pixels, rgb), 20);
  const ImageFormat grey{.width = 200, .height = 120, .pixels = PixelFormat::kMono8};
  Pixels brightness(grey.size());
  camera::from_rgb(rgb, grey, brightness);
  const camera::Picture dark = camera::decode_image(camera::encode_jpeg(grey, brightness, 95));
  EXPECT_EQ(dark.format, grey);
  EXPECT_LE(largest_difference(dark.pixels, brightness), 10);
}

TEST(Jpeg, ThatIsCutOffIsRefused) {
  const ImageFormat format{.width = 64, .height = 64, .pixels = PixelFormat::kRgb8};
  const std::string file = camera::encode_jpeg(format, smooth_rgb(64, 64), 90);
  for (std::size_t size = 2; size + 2 < file.size(); size += 7) {
    EXPECT_THROW(static_cast<void>(camera::decode_image(file.substr(0, size))), InvalidArgument)
        << size;
  }
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { static_cast<void>(camera::encode_jpeg(format, smooth_rgb(64, 64), 0)); }),
              HasSubstr("the quality of JPEG is 0, must be 1 to 100"));
}

}  // namespace
}  // namespace trifinger::test
