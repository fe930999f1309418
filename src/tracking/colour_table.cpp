// SPDX-License-Identifier: BSD-3-Clause
#include "colour_table.hpp"

#include <algorithm>
#include <cmath>

namespace trifinger::tracking::detail {
namespace {

// Pixels this bright are at the limit of a channel: their ratios mean little.
constexpr int kLevels = 256;

// A pixel has a colour if this is its most likely origin. Most pixels show the background, and few
// wrong ones among them hurt more than a few missing ones on the object.
constexpr double kBackgroundWeight = 2;
// Density of features that nobody has seen: they belong to the background.
constexpr double kUnseen = 1e-3;

// Reads the channel of one colour between the pixels that have it: every second one of every second
// row, from (left, top).
float between(const std::uint8_t* pixels, std::size_t width, float x, float y, int left,
              int top) noexcept {
  const float u = 0.5F * (x - static_cast<float>(left));
  const float v = 0.5F * (y - static_cast<float>(top));
  const float column = std::floor(u);
  const float row = std::floor(v);
  const float a = u - column;
  const float b = v - row;
  const std::uint8_t* const corner =
      pixels + (2 * static_cast<std::size_t>(row) + static_cast<std::size_t>(top)) * width +
      2 * static_cast<std::size_t>(column) + static_cast<std::size_t>(left);
  const std::uint8_t* const below = corner + 2 * width;
  const float upper = static_cast<float>(corner[0]) * (1 - a) + static_cast<float>(corner[2]) * a;
  const float lower = static_cast<float>(below[0]) * (1 - a) + static_cast<float>(below[2]) * a;
  return upper * (1 - b) + lower * b;
}

}  // namespace

ColourTable::ColourTable(const ColourModel& model, const std::vector<std::string>& colours)
    : labels_(std::size_t{1} << 3 * kBits, kNoColour) {
  constexpr int kCells = 1 << kBits;
  std::array<double, kCells> middle{};
  std::array<int, kCells> members{};
  for (int level = 0; level < kLevels; ++level) {
    const auto cell = static_cast<std::size_t>(kCells * std::sqrt((level + 0.5) / kLevels));
    cell_[static_cast<std::size_t>(level)] = static_cast<std::uint8_t>(cell);
    middle[cell] += level;
    ++members[cell];
  }
  for (std::size_t cell = 0; cell < kCells; ++cell) {
    if (members[cell] > 0) middle[cell] /= members[cell];
  }
  std::size_t place = 0;
  for (const double red : middle) {
    for (const double green : middle) {
      for (const double blue : middle) {
        const Eigen::Vector3d features = colour_features(red, green, blue);
        double best = kBackgroundWeight * model.background.density(features) + kUnseen;
        Label label = kNoColour;
        for (const Colour& colour : model.colours) {
          const double density = colour.density(features);
          if (density <= best) continue;
          best = density;
          // Colours that the object does not have belong to other things.
          const auto own = std::ranges::find(colours, colour.name);
          label = own == colours.end() ? kNoColour : static_cast<Label>(own - colours.begin());
        }
        labels_[place++] = label;
      }
    }
  }
}

LabelledImage::LabelledImage(const camera::ImageFormat& format)
    : format_(format),
      columns_(format.width / 2),
      rows_(format.height / 2),
      labels_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), kNoColour),
      sums_((static_cast<std::size_t>(columns_) + 1) * (static_cast<std::size_t>(rows_) + 1), 0) {}

void LabelledImage::read(std::span<const std::byte> pixels, const ColourTable& table) noexcept {
  pixels_ = pixels.empty() ? nullptr : reinterpret_cast<const std::uint8_t*>(pixels.data());
  if (pixels_ == nullptr) return;
  const bool is_mosaic = format_.pixels == camera::PixelFormat::kBayerRg8;
  const std::size_t stride =
      static_cast<std::size_t>(format_.width) * camera::channels(format_.pixels);
  const auto columns = static_cast<std::size_t>(columns_);
  for (std::size_t row = 0; row < static_cast<std::size_t>(rows_); ++row) {
    const std::uint8_t* upper = pixels_ + 2 * row * stride;
    const std::uint8_t* lower = upper + stride;
    Label* const labels = labels_.data() + row * columns;
    const std::uint32_t* const above = sums_.data() + row * (columns + 1);
    std::uint32_t* const sums = sums_.data() + (row + 1) * (columns + 1);
    std::uint32_t here = 0;
    for (std::size_t column = 0; column < columns; ++column) {
      Label label = kNoColour;
      if (is_mosaic) {
        label = table.label(upper[0], (unsigned{upper[1]} + lower[0]) / 2, lower[1]);
        upper += 2;
        lower += 2;
      } else {
        const auto mean = [&](std::size_t channel) {
          return (unsigned{upper[channel]} + upper[channel + 3] + lower[channel] +
                  lower[channel + 3]) /
                 4;
        };
        label = table.label(mean(0), mean(1), mean(2));
        upper += 6;
        lower += 6;
      }
      labels[column] = label;
      here += label == kNoColour ? 0 : 1;
      sums[column + 1] = above[column + 1] + here;
    }
  }
}

Rgb LabelledImage::colour(float x, float y) const noexcept {
  const auto width = static_cast<std::size_t>(format_.width);
  if (format_.pixels == camera::PixelFormat::kBayerRg8) {
    return {between(pixels_, width, x, y, 0, 0),
            0.5F * (between(pixels_, width, x, y, 1, 0) + between(pixels_, width, x, y, 0, 1)),
            between(pixels_, width, x, y, 1, 1)};
  }
  const float column = std::floor(x);
  const float row = std::floor(y);
  const float a = x - column;
  const float b = y - row;
  const std::uint8_t* const corner =
      pixels_ + 3 * (static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column));
  const auto read = [&](std::size_t channel) {
    const std::uint8_t* const p = corner + channel;
    const float upper = static_cast<float>(p[0]) * (1 - a) + static_cast<float>(p[3]) * a;
    const float lower =
        static_cast<float>(p[3 * width]) * (1 - a) + static_cast<float>(p[3 * width + 3]) * a;
    return upper * (1 - b) + lower * b;
  };
  return {read(0), read(1), read(2)};
}

}  // namespace trifinger::tracking::detail
