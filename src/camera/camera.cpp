// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/camera.hpp"

#include <algorithm>
#include <cmath>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::camera {

using trifinger::detail::text_of;

std::string_view name_of(PixelFormat format) noexcept {
  switch (format) {
    case PixelFormat::kMono8:
      return "mono8";
    case PixelFormat::kBayerRg8:
      return "bayer_rggb8";
    case PixelFormat::kRgb8:
      return "rgb8";
  }
  return "unknown";
}

namespace {

// OpenCV's model of distortion: k1 k2 p1 p2 k3.
Eigen::Vector2d distort(const std::array<double, 5>& d, const Eigen::Vector2d& ray) noexcept {
  const double x = ray.x();
  const double y = ray.y();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  return {x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x),
          y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y};
}

Eigen::Matrix2d distortion_derivative(const std::array<double, 5>& d,
                                      const Eigen::Vector2d& ray) noexcept {
  const double x = ray.x();
  const double y = ray.y();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  const double slope = 2 * (d[0] + r2 * (2 * d[1] + r2 * 3 * d[4]));  // d radial / d r2, times 2
  const double mixed = x * y * slope + 2 * d[2] * x + 2 * d[3] * y;
  Eigen::Matrix2d derivative;
  derivative << radial + x * x * slope + 2 * d[2] * y + 6 * d[3] * x, mixed,  //
      mixed, radial + y * y * slope + 6 * d[2] * y + 2 * d[3] * x;
  return derivative;
}

}  // namespace

Eigen::Vector2d Lens::project(const Eigen::Vector2d& ray) const noexcept {
  const Eigen::Vector2d bent = distort(distortion, ray);
  return {fx * bent.x() + cx, fy * bent.y() + cy};
}

Eigen::Matrix2d Lens::derivative(const Eigen::Vector2d& ray) const noexcept {
  return Eigen::Vector2d(fx, fy).asDiagonal() * distortion_derivative(distortion, ray);
}

Eigen::Vector2d Lens::unproject(const Eigen::Vector2d& pixel) const noexcept {
  const Eigen::Vector2d bent((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  Eigen::Vector2d ray = bent;
  // Newton's method: four steps reach the precision of a double for the lenses that we know.
  constexpr int kMaxSteps = 20;
  for (int i = 0; i < kMaxSteps; ++i) {
    const Eigen::Vector2d error = distort(distortion, ray) - bent;
    if (error.squaredNorm() < 1e-24) break;
    const Eigen::Matrix2d slope = distortion_derivative(distortion, ray);
    if (!(std::abs(slope.determinant()) > 1e-6)) break;
    ray -= slope.inverse() * error;
  }
  return ray;
}

Lens Lens::scaled(double factor) const noexcept {
  // Pixel centres are at whole numbers, so the image begins at -0.5.
  return {.fx = fx * factor,
          .fy = fy * factor,
          .cx = (cx + 0.5) * factor - 0.5,
          .cy = (cy + 0.5) * factor - 0.5,
          .distortion = distortion};
}

Lens Lens::cropped(int left, int top) const noexcept {
  Lens part = *this;
  part.cx -= left;
  part.cy -= top;
  return part;
}

std::optional<Eigen::Vector2d> Camera::project(const Eigen::Vector3d& point) const noexcept {
  constexpr double kNearest = 1e-6;  // [m]
  const Eigen::Vector3d seen = pose.linear().transpose() * (point - pose.translation());
  if (!(seen.z() > kNearest)) return std::nullopt;
  return lens.project(seen);
}

Camera Camera::reduced(int factor) const {
  if (factor < 1 || format.width % factor != 0 || format.height % factor != 0) {
    throw InvalidArgument(text_of("images of ", format.width, " x ", format.height,
                                  " pixels cannot be reduced by a factor of ", factor));
  }
  Camera smaller = *this;
  smaller.format.width /= factor;
  smaller.format.height /= factor;
  smaller.lens = lens.scaled(1.0 / factor);
  return smaller;
}

Camera Camera::resized(int width) const {
  if (width < 1 || width > format.width) {
    throw InvalidArgument(
        text_of("images of ", format.width, " pixels cannot become images of ", width));
  }
  const int factor = format.width / width;
  const int height = std::max(1, format.height * width / format.width);
  const int left = (format.width - factor * width) / 2;
  const int top = (format.height - factor * height) / 2;
  Camera part = *this;
  part.format.width = factor * width;
  part.format.height = factor * height;
  part.lens = lens.cropped(left, top);
  return part.reduced(factor);
}

}  // namespace trifinger::camera
