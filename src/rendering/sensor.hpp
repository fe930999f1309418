// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/rendering/options.hpp"

namespace trifinger::rendering::detail {

// The sensor of a camera: from light to levels.
class Sensor {
 public:
  Sensor(const camera::ImageFormat& format, const RenderingOptions& options);

  // Makes the image from sums of `count` samples of each value, `kOneLevel` per level. `key`
  // decides the noise.
  void expose(std::span<const std::uint32_t> sums, int count, std::uint64_t key,
              std::span<std::byte> image) noexcept;

 private:
  camera::ImageFormat format_;
  float gain_;
  float read_variance_;
  float shot_variance_;
  std::vector<float> shares_;  // of the light that reaches each value; empty: all of it everywhere
};

}  // namespace trifinger::rendering::detail
