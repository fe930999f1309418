// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <span>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/tracking/tracked_object.hpp"

// What colours are learned from: the blocks of 2 x 2 pixels of an image, row by row.
namespace trifinger::tracking {

/// The mean red, green and blue of each block, 0 to 255, with a white balance that makes most of
/// the image grey.
/// @throws InvalidArgument if the image has no colours, or another size than its format says
[[nodiscard]] std::vector<Eigen::Vector3f> balanced_blocks(const camera::ImageFormat& format,
                                                           std::span<const std::byte> pixels);

/// What the pose of an object says about a block.
enum class BlockContent : int {
  kNothing = -1,  ///< The object is elsewhere.
  kEdge = -2,     ///< The object's edges may be here.
};

/// For each block of a camera's image the index of the face that it shows if the object has this
/// `pose`, or a `BlockContent`. Whatever stands in front of the object is not known.
[[nodiscard]] std::vector<int> faces_in_blocks(const camera::Camera& camera,
                                               const TrackedObject& object,
                                               const Eigen::Isometry3d& pose);

}  // namespace trifinger::tracking
