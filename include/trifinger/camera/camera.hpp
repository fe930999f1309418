// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace trifinger::camera {

/// How the pixels of an image are stored, row by row without gaps, 8 bits per channel.
enum class PixelFormat : std::uint8_t {
  kMono8,     ///< Brightness.
  kBayerRg8,  ///< One colour per pixel; the first row begins R G, the second one G B.
  kRgb8,      ///< Three bytes per pixel: red, green, blue.
};
/// ROS's and Foxglove's name of a format: "mono8", "bayer_rggb8", "rgb8".
[[nodiscard]] std::string_view name_of(PixelFormat format) noexcept;
/// Bytes per pixel.
[[nodiscard]] constexpr std::size_t channels(PixelFormat format) noexcept {
  return format == PixelFormat::kRgb8 ? 3 : 1;
}

/// Size and kind of a camera's images.
struct ImageFormat {
  int width{540};   ///< [pixel]
  int height{540};  ///< [pixel]
  PixelFormat pixels{PixelFormat::kBayerRg8};

  /// Size of an image [bytes].
  [[nodiscard]] constexpr std::size_t size() const noexcept {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * channels(pixels);
  }
  friend bool operator==(const ImageFormat&, const ImageFormat&) = default;
};

/// The lens of a camera in OpenCV's model: a pinhole, and radial and tangential distortion.
///
/// Points are in the camera's frame: x right, y down, z forward. A pixel is (column, row), and
/// (0, 0) is the centre of the first one.
struct Lens {
  double fx{1}, fy{1};                 ///< Focal lengths [pixel].
  double cx{0}, cy{0};                 ///< Principal point [pixel].
  std::array<double, 5> distortion{};  ///< k1 k2 p1 p2 k3.

  /// Where the ray through (x, y, 1) meets the image [pixel].
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector2d& ray) const noexcept;
  /// Where a point in front of the camera is seen [pixel]. Its z must be above zero.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& point) const noexcept {
    return project(Eigen::Vector2d(point.x() / point.z(), point.y() / point.z()));
  }
  /// The derivatives of the pixel with respect to x and y of the ray (x, y, 1).
  [[nodiscard]] Eigen::Matrix2d derivative(const Eigen::Vector2d& ray) const noexcept;
  /// The ray (x, y, 1) through a pixel: the inverse of `project`, to 1e-9 of the focal length
  /// within the part of the image plane where the distortion can be inverted.
  [[nodiscard]] Eigen::Vector2d unproject(const Eigen::Vector2d& pixel) const noexcept;

  /// The lens of the same camera with images scaled by `factor`, such as 0.5 for half the size.
  [[nodiscard]] Lens scaled(double factor) const noexcept;
  /// The lens of the part of the images that begins at this pixel.
  [[nodiscard]] Lens cropped(int left, int top) const noexcept;
};

/// A calibrated camera.
struct Camera {
  std::string name;           ///< For example "camera60".
  std::string serial{"any"};  ///< The number of the device that is meant; "any" if nobody said it.
  ImageFormat format{};
  Lens lens{};
  /// Pose of the camera's frame in the world: z up, origin on the table.
  Eigen::Isometry3d pose{Eigen::Isometry3d::Identity()};

  /// Where a point of the world is seen [pixel]. Nothing if it is not in front of the camera. The
  /// pixel may lie outside the image.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point) const noexcept;
  /// The same camera with smaller images, scaled by 1 / `factor`: 2 makes 270 of 540 pixels.
  /// @throws InvalidArgument if the size cannot be divided by it
  [[nodiscard]] Camera reduced(int factor) const;
  /// The same camera with images of this width: the middle of its images, scaled by a whole number.
  /// 64 makes a pixel of 8 x 8, of the 512 x 512 in the middle of 540 x 540.
  /// @throws InvalidArgument if it is larger than that of the images, or below 1
  [[nodiscard]] Camera resized(int width) const;
};

}  // namespace trifinger::camera
