// SPDX-License-Identifier: BSD-3-Clause
#include "tracking/colour_samples.hpp"

#include <algorithm>
#include <cstdint>
#include <numbers>
#include <string>

#include "base/text_of.hpp"
#include "colour_table.hpp"
#include "trifinger/base/error.hpp"
#include "view.hpp"

namespace trifinger::tracking {

std::vector<Eigen::Vector3f> balanced_blocks(const camera::ImageFormat& format,
                                             std::span<const std::byte> pixels) {
  if (format.pixels == camera::PixelFormat::kMono8 || pixels.size() != format.size()) {
    throw InvalidArgument(trifinger::detail::text_of(
        "an image of ", pixels.size(), " bytes in the format ", camera::name_of(format.pixels),
        "; it needs colours and ", format.size(), " bytes"));
  }
  const Eigen::Vector3f gains = detail::white_balance(format, pixels).cast<float>();
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(pixels.data());
  const std::size_t channels = camera::channels(format.pixels);
  const std::size_t stride = static_cast<std::size_t>(format.width) * channels;
  std::vector<Eigen::Vector3f> blocks;
  for (int row = 0; row + 1 < format.height; row += 2) {
    for (int column = 0; column + 1 < format.width; column += 2) {
      const std::uint8_t* const upper = bytes + static_cast<std::size_t>(row) * stride +
                                        static_cast<std::size_t>(column) * channels;
      const std::uint8_t* const lower = upper + stride;
      Eigen::Vector3f mean;
      if (channels == 1) {
        mean << upper[0], 0.5F * (static_cast<float>(upper[1]) + static_cast<float>(lower[0])),
            lower[1];
      } else {
        for (Eigen::Index i = 0; i < 3; ++i) {
          mean[i] = static_cast<float>(upper[i] + upper[i + 3] + lower[i] + lower[i + 3]) / 4;
        }
      }
      blocks.emplace_back(mean.cwiseProduct(gains));
    }
  }
  return blocks;
}

std::vector<int> faces_in_blocks(const camera::Camera& camera, const TrackedObject& object,
                                 const Eigen::Isometry3d& pose) {
  constexpr double kMargin = 4;  // around edges [pixel]
  std::vector<std::string> colours;
  colours.reserve(object.faces.size());
  for (const ColouredFace& face : object.faces) colours.push_back(face.colour);
  const detail::Shape shape(object, colours);
  const detail::View view(camera, {});
  const int columns = camera.format.width / 2;
  const int rows = camera.format.height / 2;
  std::vector<int> contents(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows),
                            static_cast<int>(BlockContent::kNothing));
  if (view.seen(pose.translation()).z() < 1.5 * shape.radius) return contents;
  const detail::Projected centre = view.project_with_slope(pose.translation());
  const double reach = shape.radius * centre.slope.norm() / std::numbers::sqrt2 + 3 * kMargin;
  std::size_t block = 0;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column, ++block) {
      const Eigen::Vector2d pixel(2 * column + 0.5, 2 * row + 0.5);
      if ((pixel - centre.pixel).norm() < reach) {
        contents[block] = static_cast<int>(BlockContent::kEdge);
      }
    }
  }
  for (std::size_t i = 0; i < shape.faces.size(); ++i) {
    const detail::Face& face = shape.faces[i];
    if (detail::facing(view, pose, face) < 0.15) continue;
    const Eigen::Vector2d middle = view.project(pose * face.centre);
    std::vector<Eigen::Vector3d> sides;
    for (std::size_t k = 0; k < face.corners.size(); ++k) {
      const Eigen::Vector2d from = view.project(pose * face.corners[k]);
      const Eigen::Vector2d to = view.project(pose * face.corners[(k + 1) % face.corners.size()]);
      const Eigen::Vector2d along = (to - from).normalized();
      Eigen::Vector3d side(-along.y(), along.x(), along.y() * from.x() - along.x() * from.y());
      if (side.dot(middle.homogeneous()) < 0) side = -side;
      sides.push_back(side);
    }
    block = 0;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column, ++block) {
        const Eigen::Vector3d pixel(2 * column + 0.5, 2 * row + 0.5, 1);
        if (std::ranges::all_of(sides,
                                [&](const auto& side) { return side.dot(pixel) > kMargin; })) {
          contents[block] = static_cast<int>(i);
        }
      }
    }
  }
  return contents;
}

}  // namespace trifinger::tracking
