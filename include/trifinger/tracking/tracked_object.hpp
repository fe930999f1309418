// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/model/robot_description.hpp"

namespace trifinger::tracking {

/// A flat, convex piece of an object's surface in one colour.
struct ColouredFace {
  std::string colour;  ///< The name of a colour in the colour model.
  /// In the object's frame, anticlockwise as seen from outside [m].
  std::vector<Eigen::Vector3d> corners;
};

/// A convex object whose faces have known colours.
struct TrackedObject {
  std::string name{"cube"};
  std::vector<ColouredFace> faces;
  double rim{0};  ///< About how wide the dark rims around the faces are [m]; 0 if there are none.
};

/// A box with whole lengths `size` [m]. The colour of a face ends `rim` before its edges [m]; the
/// rest is dark.
/// @throws InvalidArgument if the rim leaves nothing of a face
[[nodiscard]] TrackedObject coloured_box(std::string name, const Eigen::Vector3d& size,
                                         const BoxColours& colours = competition_colours(),
                                         double rim = 0);

/// An object of a scene as the simulation draws it: boxes have colours and rims.
/// @throws InvalidArgument if it has no faces with different colours, like a stick or a ball
[[nodiscard]] TrackedObject tracked_object(const ObjectDescription& object);

/// A convex mesh: the hull of `vertices` [m], whose triangles have colours. Triangles of one colour
/// in one plane become one face.
/// @throws InvalidArgument if a triangle has no area or the mesh is not convex
[[nodiscard]] TrackedObject coloured_mesh(std::string name,
                                          const std::vector<Eigen::Vector3d>& vertices,
                                          const std::vector<std::array<int, 3>>& triangles,
                                          const std::vector<std::string>& colours);

/// The number of turns after which the object looks the same. If there are any, images cannot tell
/// its orientation, and no estimate of its pose is ever sure.
/// @throws InvalidArgument if the object has no faces
[[nodiscard]] int look_alikes(const TrackedObject& object);

/// A sentence that says so and what to do. Nothing if images can tell the orientation.
/// @throws InvalidArgument if the object has no faces
[[nodiscard]] std::optional<std::string> look_alike_warning(const TrackedObject& object);

}  // namespace trifinger::tracking
