// SPDX-License-Identifier: BSD-3-Clause
#include "view.hpp"

#include <algorithm>
#include <cmath>

namespace trifinger::rendering::detail {
namespace {

using camera::PixelFormat;

constexpr double kNear = 0.02;  // [m]; a camera of the robot is 0.2 m or more away from all parts
constexpr double kFar = 20;

// The channel of a value of a Bayer mosaic: R G in even rows, G B in odd ones.
std::uint32_t bayer_channel(int column, int row) noexcept {
  return static_cast<std::uint32_t>((column & 1) + (row & 1));
}

}  // namespace

View::View(const camera::Camera& camera, double detail)
    : camera_(camera),
      focal_(detail * std::max(std::abs(camera.lens.fx), std::abs(camera.lens.fy))),
      samples_(std::max(1, static_cast<int>(std::lround(detail)))) {
  const camera::Lens& lens = camera.lens;

  // The rays along the border of the image are the outermost ones.
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9);
  Eigen::Vector2d high = -low;
  const auto add = [&](int column, int row) {
    const Eigen::Vector2d ray = lens.unproject(Eigen::Vector2d(column, row));
    low = low.cwiseMin(ray);
    high = high.cwiseMax(ray);
    const Eigen::Vector3d direction = camera.pose.linear() * Eigen::Vector3d(ray.x(), ray.y(), 1);
    highest_ = std::max(highest_, direction.z() / direction.norm());
  };
  const int right = camera.format.width - 1;
  const int bottom = camera.format.height - 1;
  for (int column = 0; column <= right; ++column) add(column, 0), add(column, bottom);
  for (int row = 0; row <= bottom; ++row) add(0, row), add(right, row);

  // Two pixels more on each side, so that all four neighbours of every place exist.
  constexpr double kMargin = 2;
  left_ = low.x() - kMargin / focal_;
  bottom_ = -high.y() - kMargin / focal_;
  width_ = static_cast<int>(std::ceil((high.x() - left_) * focal_ + kMargin));
  height_ = static_cast<int>(std::ceil((-low.y() - bottom_) * focal_ + kMargin));
}

mjvGLCamera View::gl_camera() const noexcept {
  mjvGLCamera gl{};
  const Eigen::Vector3f position = camera_.pose.translation().cast<float>();
  const Eigen::Matrix3f axes = camera_.pose.linear().cast<float>();
  for (int i = 0; i < 3; ++i) {
    gl.pos[i] = position[i];
    gl.forward[i] = axes(i, 2);
    gl.up[i] = -axes(i, 1);
  }
  // Without a width, MuJoCo makes it from the height and the shape of the viewport: pixels are
  // squares.
  gl.frustum_center = static_cast<float>(kNear * (left_ + width_ / focal_ / 2));
  gl.frustum_width = 0;
  gl.frustum_bottom = static_cast<float>(kNear * bottom_);
  gl.frustum_top = static_cast<float>(kNear * (bottom_ + height_ / focal_));
  gl.frustum_near = static_cast<float>(kNear);
  gl.frustum_far = static_cast<float>(kFar);
  return gl;
}

bool View::sees(const Eigen::Vector3d& centre, double radius) const noexcept {
  const Eigen::Vector3d at =
      camera_.pose.linear().transpose() * (centre - camera_.pose.translation());
  const double x = at.x();
  const double y = -at.y();
  const double z = at.z();
  const auto inside = [&](double place, double tangent) {  // of the plane place = tangent * z
    return place - tangent * z < radius * std::sqrt(1 + tangent * tangent);
  };
  return z > -radius && inside(-x, -left_) && inside(x, left_ + width_ / focal_) &&
         inside(-y, -bottom_) && inside(y, bottom_ + height_ / focal_);
}

double View::pixels_per_metre(const Eigen::Vector3d& place) const noexcept {
  const double distance = (place - camera_.pose.translation()).norm();
  return std::max(camera_.lens.fx, camera_.lens.fy) / std::max(distance, kNear);
}

Eigen::Vector2d View::in_picture(const Eigen::Vector2d& ray) const noexcept {
  // (0, 0) is the centre of the pixel at the bottom on the left.
  return {(ray.x() - left_) * focal_ - 0.5, (-ray.y() - bottom_) * focal_ - 0.5};
}

View::Tap View::tap(const Eigen::Vector2d& pixel, int left) const noexcept {
  const Eigen::Vector2d at = in_picture(camera_.lens.unproject(pixel));
  // A lens that cannot be inverted at a corner shows the edge of the picture there.
  const double x = std::clamp(at.x(), 0.0, width_ - 1.001);
  const double y = std::clamp(at.y(), 0.0, height_ - 1.001);
  return {.offset =
              static_cast<std::uint32_t>(y) * row_bytes_ +
              (static_cast<std::uint32_t>(left) + static_cast<std::uint32_t>(x)) * kPictureChannels,
          .right = static_cast<std::uint16_t>(std::lround((x - std::floor(x)) * 256)),
          .up = static_cast<std::uint16_t>(std::lround((y - std::floor(y)) * 256))};
}

void View::place(int left, int stride) {
  const camera::ImageFormat& format = camera_.format;
  row_bytes_ = static_cast<std::uint32_t>(stride * kPictureChannels);
  taps_.clear();
  taps_.reserve(format.size() * static_cast<std::size_t>(samples()));
  // The middle of part `i` of a pixel, from the pixel's centre.
  const auto part = [this](int i) { return (i + 0.5) / samples_ - 0.5; };
  for (int row = 0; row < format.height; ++row) {
    for (int column = 0; column < format.width; ++column) {
      for (int i = 0; i < samples_; ++i) {
        for (int k = 0; k < samples_; ++k) {
          Tap found = tap(Eigen::Vector2d(column + part(k), row + part(i)), left);
          if (format.pixels == PixelFormat::kBayerRg8) found.offset += bayer_channel(column, row);
          taps_.push_back(found);
        }
      }
    }
  }
}

void View::sample(const std::uint8_t* pictures, std::span<std::uint32_t> values) const noexcept {
  const std::uint32_t row = row_bytes_;
  const auto between = [row](const std::uint8_t* pixel, const Tap& tap) {
    const std::uint32_t left = 256U - tap.right;
    const std::uint32_t below = pixel[0] * left + pixel[kPictureChannels] * tap.right;
    const std::uint32_t above = pixel[row] * left + pixel[row + kPictureChannels] * tap.right;
    return (below * (256U - tap.up) + above * tap.up) >> 8;
  };
  // Calls `add` with each pixel of the image and the four pixels of each sample.
  const auto for_each_sample = [&](const auto& add) {
    const auto count = static_cast<std::size_t>(samples());
    const Tap* tap = taps_.data();
    for (std::size_t i = 0; i < taps_.size() / count; ++i) {
      for (std::size_t k = 0; k < count; ++k, ++tap) add(i, pictures + tap->offset, *tap);
    }
  };
  switch (camera_.format.pixels) {
    case PixelFormat::kBayerRg8:
      for_each_sample([&](std::size_t i, const std::uint8_t* pixel, const Tap& tap) {
        values[i] += between(pixel, tap);
      });
      break;
    case PixelFormat::kRgb8:
      for_each_sample([&](std::size_t i, const std::uint8_t* pixel, const Tap& tap) {
        for (std::size_t c = 0; c < 3; ++c) values[3 * i + c] += between(pixel + c, tap);
      });
      break;
    case PixelFormat::kMono8:
      // The usual weights of red, green and blue in brightness, of 256.
      for_each_sample([&](std::size_t i, const std::uint8_t* pixel, const Tap& tap) {
        values[i] += (77 * between(pixel, tap) + 150 * between(pixel + 1, tap) +
                      29 * between(pixel + 2, tap)) >>
                     8;
      });
      break;
  }
}

}  // namespace trifinger::rendering::detail
