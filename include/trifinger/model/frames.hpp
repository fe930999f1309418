// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "trifinger/model/scene_model.hpp"

namespace trifinger {

/// Where a frame is, in the world frame.
struct FramePose {
  std::array<double, 3> position{};                       ///< x y z [m]
  std::array<double, 4> orientation{1.0, 0.0, 0.0, 0.0};  ///< Quaternion w x y z.
};

/// Where named frames of a model are: forward kinematics without any other physics.
///
/// It is constant: any number of threads may share it. Only the constructor allocates or throws.
class Frames {
 public:
  /// `names` are those of sites, bodies or geoms; a site goes before a body of the same name.
  /// @throws InvalidArgument that names the frames there are, or one that no joint moves
  Frames(std::shared_ptr<const SceneModel> model, std::span<const std::string> names);

  [[nodiscard]] std::size_t size() const noexcept { return chains_.size(); }
  /// Computes x, y, z of each frame in the world frame [m], in the order of the names.
  /// `configuration` are positions in the order of MuJoCo's `qpos`.
  void positions(std::span<const double> configuration, std::span<double> positions) const noexcept;
  /// Computes x, y, z of one frame [m].
  [[nodiscard]] std::array<double, 3> position(
      std::size_t frame, std::span<const double> configuration) const noexcept;
  /// Computes position and orientation of one frame.
  [[nodiscard]] FramePose pose(std::size_t frame,
                               std::span<const double> configuration) const noexcept;
  /// Computes the derivative of the position of one frame by the hinges and slides of its chain
  /// [m/rad], [m/m]: three rows of as many numbers as MuJoCo's `qvel` has. Other numbers are left
  /// alone. With six rows the others are the angular velocity for each velocity of a joint.
  void jacobian(std::size_t frame, std::span<const double> configuration,
                std::span<double> jacobian) const noexcept;

 private:
  // A frame: the bodies from the world to it, and its place in the last one.
  struct Chain {
    std::vector<int> bodies;
    // The frame in that body: three and four numbers of the model; null: the body itself.
    const double* position;
    const double* orientation;
  };

  std::shared_ptr<const SceneModel> model_;
  std::vector<Chain> chains_;
};

/// Names the frames at the ends of a robot: the tips of a TriFinger; for a file each body without
/// further bodies that a driven joint moves, or the first site of such a body. Bodies and sites
/// without a name are left out.
[[nodiscard]] std::vector<std::string> end_frames(const SceneModel& model);

}  // namespace trifinger
