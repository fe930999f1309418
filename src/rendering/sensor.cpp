// SPDX-License-Identifier: BSD-3-Clause
#include "sensor.hpp"

#include <algorithm>
#include <cmath>

#include "view.hpp"

namespace trifinger::rendering::detail {
namespace {

// A nearly normal random number with mean 0 and standard deviation 1, decided by `number`: the sum
// of four bytes of its hash. It is never beyond 3.45.
float noise(std::uint32_t number) noexcept {
  number ^= number >> 16;
  number *= 0x7feb352dU;
  number ^= number >> 15;
  number *= 0x846ca68bU;
  number ^= number >> 16;
  const std::uint32_t pairs = (number & 0x00ff00ffU) + ((number >> 8) & 0x00ff00ffU);
  const auto sum = static_cast<std::int32_t>((pairs & 0xffffU) + (pairs >> 16));
  constexpr float kDeviation = 147.8F;  // sqrt(4 * (256^2 - 1) / 12)
  return static_cast<float>(sum - 510) * (1 / kDeviation);
}

}  // namespace

Sensor::Sensor(const camera::ImageFormat& format, const RenderingOptions& options)
    : format_(format),
      gain_(static_cast<float>(options.gain)),
      read_variance_(static_cast<float>(options.read_noise * options.read_noise)),
      shot_variance_(static_cast<float>(options.shot_noise)) {
  if (options.vignetting == 0) return;
  const double cx = (format.width - 1) / 2.0;
  const double cy = (format.height - 1) / 2.0;
  for (int row = 0; row < format.height; ++row) {
    for (int column = 0; column < format.width; ++column) {
      const double x = (column - cx) / cx;
      const double y = (row - cy) / cy;
      const auto share = static_cast<float>(1 - options.vignetting * (x * x + y * y) / 2);
      shares_.insert(shares_.end(), channels(format.pixels), share);
    }
  }
}

void Sensor::expose(std::span<const std::uint32_t> sums, int count, std::uint64_t key,
                    std::span<std::byte> image) noexcept {
  const float scale = gain_ / (static_cast<float>(kOneLevel) * static_cast<float>(count));
  const auto low = static_cast<std::uint32_t>(key * 0x9e3779b97f4a7c15U >> 32);
  const std::size_t size = format_.size();
  const std::uint32_t* const values = sums.data();
  const float* const shares = shares_.empty() ? nullptr : shares_.data();
  const bool is_noisy = read_variance_ > 0 || shot_variance_ > 0;
  auto* const levels = reinterpret_cast<std::uint8_t*>(image.data());
  for (std::size_t i = 0; i < size; ++i) {
    float level = scale * static_cast<float>(values[i]);
    if (shares != nullptr) level *= shares[i];
    if (is_noisy) {
      level += std::sqrt(read_variance_ + shot_variance_ * level) *
               noise(low + static_cast<std::uint32_t>(i));
    }
    // A conversion rounds towards zero.
    levels[i] = static_cast<std::uint8_t>(std::clamp(level + 0.5F, 0.0F, 255.0F));
  }
}

}  // namespace trifinger::rendering::detail
