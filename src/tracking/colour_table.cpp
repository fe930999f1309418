// SPDX-License-Identifier: BSD-3-Clause
#include "colour_table.hpp"

#include <algorithm>
#include <cmath>

namespace trifinger::tracking::detail {
namespace {

constexpr int kLevels = 256;

// A pixel has a colour if this is its most likely origin. Most pixels show the background, and few
// wrong ones among them hurt more than a few missing ones on the object.
constexpr double kBackgroundWeight = 2;
// The second colour counts if it is likelier than this share of the first.
constexpr double kMayBe = 0.03;
// Density of features that nobody has seen: they belong to the background.
constexpr double kUnseen = 1e-3;
// The share of pixels of a face that show something in front.
constexpr double kHidden = 0.05;

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
    : labels_(std::size_t{1} << 3 * kBits),
      num_colours_(colours.size()),
      evidence_(colours.size() << 3 * kBits, 0.0F) {
  constexpr std::size_t kCells = std::size_t{1} << kBits;
  std::array<double, kCells> middle{};
  std::array<int, kCells> members{};
  for (int level = 0; level < kLevels; ++level) {
    middle[cell(level)] += level;
    ++members[cell(level)];
  }
  for (std::size_t i = 0; i < kCells; ++i) {
    if (members[i] > 0) middle[i] /= members[i];
  }
  std::size_t place = 0;
  for (const double red : middle) {
    for (const double green : middle) {
      for (const double blue : middle) {
        const Eigen::Vector3d features = colour_features(red, green, blue);
        const double background = kBackgroundWeight * model.background.density(features) + kUnseen;
        double best = background;
        double next = 0;
        Labels labels;
        for (const Colour& colour : model.colours) {
          const double density = colour.density(features);
          // Colours that the object does not have belong to other things.
          const auto own = std::ranges::find(colours, colour.name);
          const Label label =
              own == colours.end() ? kNoColour : static_cast<Label>(own - colours.begin());
          if (label != kNoColour) {
            evidence_[num_colours_ * place + label] = static_cast<float>(density);
          }
          if (density <= std::max(next, kMayBe * background)) continue;
          if (density > best) {
            labels = {label, labels.first};
            next = best == background ? 0 : best;
            best = density;
          } else {
            labels.second = label;
            next = density;
          }
        }
        float* const densities = evidence_.data() + num_colours_ * place;
        double sum = background;
        for (std::size_t k = 0; k < num_colours_; ++k) sum += static_cast<double>(densities[k]);
        for (std::size_t k = 0; k < num_colours_; ++k) {
          densities[k] = static_cast<float>(
              std::log(kHidden + (1 - kHidden) * static_cast<double>(densities[k]) / sum));
        }
        // Things that are most likely not of the object are not of the object.
        if (!labels.is_coloured() || next < kMayBe * best) labels.second = kNoColour;
        labels_[place++] = labels;
      }
    }
  }
}

std::size_t ColourTable::cell(double brightness) noexcept {
  constexpr double kCells = 1 << kBits;
  return static_cast<std::size_t>(
      std::min(kCells - 1, kCells * std::sqrt((brightness + 0.5) / kLevels)));
}

void ColourTable::set_cells(const Eigen::Vector3d& gains, Cells& cells) noexcept {
  for (std::size_t channel = 0; channel < cells.size(); ++channel) {
    for (std::size_t level = 0; level < kLevels; ++level) {
      cells[channel][level] = static_cast<std::uint8_t>(
          cell(static_cast<double>(level) * gains[static_cast<Eigen::Index>(channel)]));
    }
  }
}

Eigen::Vector3d white_balance(const camera::ImageFormat& format,
                              std::span<const std::byte> pixels) noexcept {
  constexpr int kPerOctave = 32;           // bins
  constexpr int kMiddle = 2 * kPerOctave;  // ratios from a quarter to four
  constexpr int kBins = 2 * kMiddle + 1;
  constexpr unsigned kDark = 12;
  constexpr unsigned kBright = 250;
  static const std::array<int, kLevels> logs = [] {
    std::array<int, kLevels> table{};
    for (std::size_t i = 1; i < kLevels; ++i) {
      table[i] = static_cast<int>(std::lround(kPerOctave * std::log2(static_cast<double>(i))));
    }
    return table;
  }();
  std::array<int, kBins> reds{};
  std::array<int, kBins> blues{};
  int count = 0;
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(pixels.data());
  const std::size_t channels = camera::channels(format.pixels);
  const auto width = static_cast<std::size_t>(format.width);
  const auto height = static_cast<std::size_t>(format.height);
  for (std::size_t row = 0; row + 1 < height; row += 8) {
    for (std::size_t column = 0; column + 1 < width; column += 8) {
      const std::uint8_t* const p = bytes + (row * width + column) * channels;
      unsigned red = p[0];
      unsigned green = p[1];
      unsigned blue = p[2];
      if (format.pixels == camera::PixelFormat::kBayerRg8) {
        green = (unsigned{p[1]} + p[width]) / 2;
        blue = p[width + 1];
      }
      if (green < kDark || std::max({red, green, blue}) > kBright) continue;
      const auto bin = [&](unsigned level) {
        return static_cast<std::size_t>(
            std::clamp(logs[level] - logs[green] + kMiddle, 0, kBins - 1));
      };
      ++reds[bin(red)];
      ++blues[bin(blue)];
      ++count;
    }
  }
  constexpr int kEnough = 100;
  if (count < kEnough) return Eigen::Vector3d::Ones();
  const auto median = [count](const std::array<int, kBins>& bins) {
    int below = 0;
    std::size_t i = 0;
    while (2 * (below + bins[i]) < count) below += bins[i++];
    const double within = (0.5 * count - below) / bins[i];
    return (static_cast<double>(i) - 0.5 + within - kMiddle) / kPerOctave;
  };
  // The balance changes the colours, not the brightness.
  const double red = median(reds);
  const double blue = median(blues);
  const double mean = (red + blue) / 3;
  return {std::exp2(mean - red), std::exp2(mean), std::exp2(mean - blue)};
}

LabelledImage::LabelledImage(const camera::ImageFormat& format, std::vector<double> most)
    : format_(format),
      columns_(format.width / 2),
      rows_(format.height / 2),
      labels_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)),
      most_(std::move(most)),
      weights_(most_.size(), 1.0),
      counts_(most_.size(), 0),
      steps_(most_.size(), 0),
      sums_((static_cast<std::size_t>(columns_) + 1) * (static_cast<std::size_t>(rows_) + 1), 0) {}

void LabelledImage::read(std::span<const std::byte> pixels, const ColourTable& table) noexcept {
  pixels_ = pixels.empty() ? nullptr : reinterpret_cast<const std::uint8_t*>(pixels.data());
  if (pixels_ == nullptr) return;
  balance_ = white_balance(format_, pixels);
  other_balance_.setOnes();
  label(balance_, table);
}

void LabelledImage::read_again(const Eigen::Vector3d& light, const ColourTable& table) noexcept {
  if (pixels_ != nullptr) label(balance_.cwiseProduct(light), table);
}

void LabelledImage::read_unbalanced(const ColourTable& table) noexcept {
  other_balance_ = balance_;
  balance_.setOnes();
  if (pixels_ != nullptr) label(balance_, table);
}

void LabelledImage::label(const Eigen::Vector3d& gains, const ColourTable& table) noexcept {
  ColourTable::set_cells(gains, cells_);
  std::ranges::fill(counts_, 0U);
  const bool is_mosaic = format_.pixels == camera::PixelFormat::kBayerRg8;
  const std::size_t stride =
      static_cast<std::size_t>(format_.width) * camera::channels(format_.pixels);
  const auto columns = static_cast<std::size_t>(columns_);
  const auto rows = static_cast<std::size_t>(rows_);
  for (std::size_t row = 0; row < rows; ++row) {
    const std::uint8_t* upper = pixels_ + 2 * row * stride;
    const std::uint8_t* lower = upper + stride;
    Labels* const row_labels = labels_.data() + row * columns;
    for (std::size_t column = 0; column < columns; ++column) {
      Labels labels;
      if (is_mosaic) {
        // On an edge, the pixels of a block show different things, and their mixture is no colour.
        const int greens = upper[1] + lower[0];
        if (4 * std::abs(upper[1] - lower[0]) <= greens + 24) {
          labels = table.labels(cells_, upper[0], static_cast<unsigned>(greens) / 2, lower[1]);
        }
        upper += 2;
        lower += 2;
      } else {
        const auto mean = [&](std::size_t channel) {
          return (unsigned{upper[channel]} + upper[channel + 3] + lower[channel] +
                  lower[channel + 3]) /
                 4;
        };
        labels = table.labels(cells_, mean(0), mean(1), mean(2));
        upper += 6;
        lower += 6;
      }
      row_labels[column] = labels;
      if (labels.is_coloured()) ++counts_[labels.first];
    }
  }
  sum_up();
}

void LabelledImage::sum_up() noexcept {
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    weights_[i] = std::min(1.0, most_[i] / std::max(1.0, static_cast<double>(counts_[i])));
    // Far more of a colour than there can be: it says even less than its share.
    weights_[i] *= weights_[i];
    steps_[i] = static_cast<std::uint32_t>(std::lround(kUnit * weights_[i]));
  }
  const auto columns = static_cast<std::size_t>(columns_);
  const auto rows = static_cast<std::size_t>(rows_);
  for (std::size_t row = 0; row < rows; ++row) {
    const Labels* const labels = labels_.data() + row * columns;
    const std::uint32_t* const above = sums_.data() + row * (columns + 1);
    std::uint32_t* const sums = sums_.data() + (row + 1) * (columns + 1);
    std::uint32_t here = 0;
    for (std::size_t column = 0; column < columns; ++column) {
      if (labels[column].is_coloured()) here += steps_[labels[column].first];
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
