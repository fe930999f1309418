// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "trifinger/camera/camera.hpp"

namespace trifinger::rendering::detail {

// Bytes per pixel of a drawn picture: red, green, blue, and one that is not used.
inline constexpr int kPictureChannels = 4;
// Sums of pictures have this much per level of the image.
inline constexpr std::uint32_t kOneLevel = 256;

// One camera's part of the drawn pictures: a picture without distortion, larger than the image, and
// the way from there to the image. The pictures of all cameras lie side by side.
class View {
 public:
  // `detail` is the number of pixels of the picture per pixel in the middle of the image.
  View(const camera::Camera& camera, double detail);

  // Samples of each value of the image: `sample` adds so many times.
  [[nodiscard]] int samples() const noexcept { return samples_ * samples_; }
  [[nodiscard]] int width() const noexcept { return width_; }    // of the picture
  [[nodiscard]] int height() const noexcept { return height_; }  // of the picture

  // The camera in MuJoCo's terms.
  [[nodiscard]] mjvGLCamera gl_camera() const noexcept;
  // False if a ball is certainly outside the picture.
  [[nodiscard]] bool sees(const Eigen::Vector3d& centre, double radius) const noexcept;
  // Pixels of the image that a movement of 1 m covers at most, at this place.
  [[nodiscard]] double pixels_per_metre(const Eigen::Vector3d& place) const noexcept;
  // False if no ray of the picture is flatter than this angle below the horizon, given as its sine.
  [[nodiscard]] bool looks_above(double sine) const noexcept { return highest_ > sine; }

  // Makes the table that `sample` uses: the picture begins at column `left` of pictures that are
  // `stride` pixels wide.
  void place(int left, int stride);
  // Adds to each value of the image what it shows, `kOneLevel` per level.
  void sample(const std::uint8_t* pictures, std::span<std::uint32_t> values) const noexcept;

 private:
  // A place of the picture, between four of its pixels.
  struct Tap {
    std::uint32_t offset;  // of the channel of the pixel below and left [byte]
    std::uint16_t right;   // share of the pixel to the right, of 256
    std::uint16_t up;      // share of the row above, of 256
  };

  [[nodiscard]] Eigen::Vector2d in_picture(const Eigen::Vector2d& ray) const noexcept;
  [[nodiscard]] Tap tap(const Eigen::Vector2d& pixel, int left) const noexcept;

  camera::Camera camera_;
  double focal_;          // of the picture [pixel]
  double left_, bottom_;  // tangents of its edges, in OpenGL's frame: y up
  int width_, height_;
  double highest_{-1};
  int samples_;  // of a pixel of the image in each direction
  std::uint32_t row_bytes_{0};
  std::vector<Tap> taps_;  // of each value, or of each pixel of several values, all samples
};

}  // namespace trifinger::rendering::detail
