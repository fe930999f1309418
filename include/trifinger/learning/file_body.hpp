// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/learning/environment.hpp"
#include "trifinger/model/contact_check.hpp"
#include "trifinger/model/frames.hpp"
#include "trifinger/sim/simulator.hpp"

namespace trifinger::learning {

/// What tasks know of a robot from a file: its joints, and where its frames are. It is constant,
/// and threads may share it.
class FileBody {
 public:
  /// The largest number of positions of a model, in MuJoCo's `qpos`.
  static constexpr std::size_t kMaxConfiguration = 512;

  /// `frames` are names as for `Frames`.
  /// @throws InvalidArgument if there is no such frame, if there are too many of them, or if the
  /// model is too large
  FileBody(const SimulationOptions& robot, std::span<const std::string> frames);

  [[nodiscard]] const SceneModel& model() const noexcept { return simulator_.model(); }
  [[nodiscard]] std::span<const JointLimit> limits() const noexcept { return simulator_.limits(); }
  /// Where the driven joints begin [rad], [m].
  [[nodiscard]] std::span<const double> initial_position() const noexcept {
    return simulator_.initial_position();
  }
  /// Where everything begins, in the order of MuJoCo's `qpos`.
  [[nodiscard]] const std::vector<double>& initial_configuration() const noexcept {
    return simulator_.initial_configuration();
  }
  [[nodiscard]] std::size_t num_joints() const noexcept { return simulator_.num_joints(); }
  [[nodiscard]] std::size_t num_frames() const noexcept { return frames_.size(); }

  /// Place of a driven joint among those of an action.
  /// @throws InvalidArgument that names the joints there are
  [[nodiscard]] std::size_t joint(std::string_view name) const;
  /// Place of a hinge or slide, driven or not, in `View::model_position`.
  /// @throws InvalidArgument that names the joints there are
  [[nodiscard]] std::size_t model_joint(std::string_view name) const;

  /// Computes where the frames are in a pose: x, y, z for each [m]. `model_position` and `bodies`
  /// are as in `Measurement`.
  void find_frames(std::span<const double> position, std::span<const double> model_position,
                   std::span<const ObjectPose> bodies, std::span<double> points) const noexcept;

  /// Draws positions of the driven joints between `low` and `high` until no parts touch that do not
  /// touch at the beginning, and computes where the frames are then. Everything else stays where it
  /// begins.
  void draw_pose(std::span<const double> low, std::span<const double> high, Random& random,
                 std::span<double> points) const noexcept;
  /// Bounds of where the frames may be with the driven joints between `low` and `high`, from poses
  /// drawn at random, and a little more [m].
  [[nodiscard]] Entry frame_bounds(std::string name, std::span<const double> low,
                                   std::span<const double> high) const;

 private:
  Simulator simulator_;
  Frames frames_;
  ContactCheck contacts_;
};

}  // namespace trifinger::learning
