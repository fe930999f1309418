// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/tracking/colour_model.hpp"

namespace trifinger::tracking::detail {

// The number of a colour of the object; `kNoColour` for everything else.
using Label = std::uint8_t;
constexpr Label kNoColour = 255;

// The colour that a pixel most likely has, and another one that it may well have; both can be
// missing. Light can make two colours look alike, so whoever knows which one is expected asks
// `may_be`.
struct Labels {
  Label first{kNoColour};
  Label second{kNoColour};

  [[nodiscard]] bool may_be(Label label) const noexcept {
    return first == label || second == label;
  }
  [[nodiscard]] bool is_coloured() const noexcept { return first != kNoColour; }
};

// Brightness of the three channels, 0 to 255.
using Rgb = Eigen::Vector3f;

// For each channel and brightness the cell of a `ColourTable`.
using Cells = std::array<std::array<std::uint8_t, 256>, 3>;

// Which colour of the object a pixel has, by table.
class ColourTable {
 public:
  // Labels are places in `colours`. Every name must be in the model.
  ColourTable(const ColourModel& model, const std::vector<std::string>& colours);

  [[nodiscard]] std::size_t num_colours() const noexcept { return num_colours_; }
  // For each colour, how well it explains a pixel: the log of its probability. Something may stand
  // in front of any pixel of a face, so it has a lower bound.
  [[nodiscard]] const float* evidence(const Rgb& colour) const noexcept {
    const auto at = [&](int channel) { return cell(static_cast<double>(colour[channel])); };
    const std::size_t place = at(0) << 2 * kBits | at(1) << kBits | at(2);
    return evidence_.data() + num_colours_ * place;
  }

  // The cells of an image whose channels are multiplied by `gains` first.
  static void set_cells(const Eigen::Vector3d& gains, Cells& cells) noexcept;

  [[nodiscard]] Labels labels(const Cells& cells, unsigned red, unsigned green,
                              unsigned blue) const noexcept {
    return labels_[static_cast<std::size_t>(cells[0][red]) << 2 * kBits |
                   static_cast<std::size_t>(cells[1][green]) << kBits | cells[2][blue]];
  }

 private:
  static constexpr unsigned kBits = 5;
  // Finer for dark pixels, whose colour changes faster.
  static std::size_t cell(double brightness) noexcept;

  std::vector<Labels> labels_;
  std::size_t num_colours_;
  std::vector<float> evidence_;
};

// The gains that make most of an image grey: tables, walls and fingers are, whatever the light and
// the camera's white balance are. Images without enough light are left as they are.
[[nodiscard]] Eigen::Vector3d white_balance(const camera::ImageFormat& format,
                                            std::span<const std::byte> pixels) noexcept;

// The image of one camera: its pixels, which belong to somebody else, and the labels of its blocks
// of 2 x 2 pixels.
class LabelledImage {
 public:
  // `most` has for each colour the number of blocks that the object can show of it.
  LabelledImage(const camera::ImageFormat& format, std::vector<double> most);

  // Reads the image. Without pixels there is none.
  void read(std::span<const std::byte> pixels, const ColourTable& table) noexcept;
  // Reads it again in another light: as if its channels were multiplied by `light` besides the
  // balance.
  void read_again(const Eigen::Vector3d& light, const ColourTable& table) noexcept;
  // Reads it again as the camera took it.
  void read_unbalanced(const ColourTable& table) noexcept;
  // The white balance of the image; another light does not change it.
  [[nodiscard]] const Eigen::Vector3d& balance() const noexcept { return balance_; }
  // The white balance that `read_unbalanced` has left out; ones after `read`.
  [[nodiscard]] const Eigen::Vector3d& other_balance() const noexcept { return other_balance_; }
  [[nodiscard]] bool exists() const noexcept { return pixels_ != nullptr; }

  // Size in blocks.
  [[nodiscard]] int columns() const noexcept { return columns_; }
  [[nodiscard]] int rows() const noexcept { return rows_; }
  [[nodiscard]] Labels labels(int column, int row) const noexcept {
    return labels_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)];
  }
  // The labels at a pixel; none outside the image.
  [[nodiscard]] Labels labels_at(const Eigen::Vector2d& pixel) const noexcept {
    const double x = 0.5 * pixel.x() + 0.25;  // the centre of block 0 is at pixel 0.5
    const double y = 0.5 * pixel.y() + 0.25;
    const bool is_inside = x >= 0 && y >= 0 && x < columns_ && y < rows_;
    return is_inside ? labels(static_cast<int>(x), static_cast<int>(y)) : Labels{};
  }
  // Whether `margin` pixels around this pixel belong to the image.
  [[nodiscard]] bool contains(const Eigen::Vector2d& pixel, double margin) const noexcept {
    return pixel.x() >= margin && pixel.y() >= margin && pixel.x() <= format_.width - 1 - margin &&
           pixel.y() <= format_.height - 1 - margin;
  }
  // How much a block of this colour says, from 0 to 1. A colour of which there is far more than the
  // object has is that of a table or a hand, too.
  [[nodiscard]] double weight(Label label) const noexcept { return weights_[label]; }
  // Sum of the weights of blocks in columns [left, right) and rows [top, bottom).
  [[nodiscard]] double coloured(int left, int top, int right, int bottom) const noexcept {
    return (sum(right, bottom) - sum(left, bottom) - sum(right, top) + sum(left, top)) / kUnit;
  }
  // The labels of a colour that `colour` returned.
  [[nodiscard]] Labels labels_of(const ColourTable& table, const Rgb& colour) const noexcept {
    return table.labels(cells_, static_cast<unsigned>(colour[0]), static_cast<unsigned>(colour[1]),
                        static_cast<unsigned>(colour[2]));
  }
  // The colour at a pixel, between pixels of the same channel. At least 2 pixels from the edge.
  [[nodiscard]] Rgb colour(float x, float y) const noexcept;

 private:
  void label(const Eigen::Vector3d& gains, const ColourTable& table) noexcept;
  void sum_up() noexcept;

  static constexpr double kUnit = 1024;  // weights are summed in whole numbers

  [[nodiscard]] std::uint32_t sum(int column, int row) const noexcept {
    return sums_[static_cast<std::size_t>(row) * (static_cast<std::size_t>(columns_) + 1) +
                 static_cast<std::size_t>(column)];
  }

  camera::ImageFormat format_;
  int columns_;
  int rows_;
  const std::uint8_t* pixels_{nullptr};
  Eigen::Vector3d balance_{Eigen::Vector3d::Ones()};
  Eigen::Vector3d other_balance_{Eigen::Vector3d::Ones()};
  Cells cells_{};
  std::vector<Labels> labels_;
  std::vector<double> most_;
  std::vector<double> weights_;
  std::vector<std::uint32_t> counts_;  // of blocks of each colour
  std::vector<std::uint32_t> steps_;   // weights in units
  std::vector<std::uint32_t> sums_;    // of the weights of blocks to the left and above
};

}  // namespace trifinger::tracking::detail
