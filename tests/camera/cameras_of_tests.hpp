// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "trifinger/camera/camera.hpp"

namespace trifinger::test {

/// Three cameras with small images.
[[nodiscard]] inline std::vector<camera::Camera> three_cameras(
    camera::PixelFormat pixels = camera::PixelFormat::kBayerRg8, int size = 32) {
  std::vector<camera::Camera> cameras;
  for (const char* const name : {"camera60", "camera180", "camera300"}) {
    camera::Camera camera;
    camera.name = name;
    camera.format = {.width = size, .height = size, .pixels = pixels};
    camera.lens = {.fx = 35, .fy = 35, .cx = 16, .cy = 15, .distortion = {-0.2}};
    cameras.push_back(camera);
  }
  return cameras;
}

/// Fills an image with numbers that say which camera's and which image it is.
inline void fill_pattern(std::span<std::byte> pixels, std::size_t camera, std::int64_t number) {
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = static_cast<std::byte>(i * 7 + camera * 50 + static_cast<std::size_t>(number) * 3);
  }
}
[[nodiscard]] inline bool has_pattern(std::span<const std::byte> pixels, std::size_t camera,
                                      std::int64_t number) {
  std::vector<std::byte> expected(pixels.size());
  fill_pattern(expected, camera, number);
  return std::equal(pixels.begin(), pixels.end(), expected.begin());
}

}  // namespace trifinger::test
