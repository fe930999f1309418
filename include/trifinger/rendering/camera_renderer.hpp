// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/model/scene_model.hpp"
#include "trifinger/rendering/options.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::rendering {

/// Draws what cameras see of a simulated scene: lens with distortion, Bayer mosaic, blur of what
/// moves, noise.
///
/// A point of the scene appears where `camera::Camera::project` says, to a tenth of a pixel. Equal
/// arguments give equal images on one machine, bit for bit.
///
/// Any thread may use a renderer, one thread at a time.
class CameraRenderer {
 public:
  /// @throws InvalidArgument, Error that says what to install if this machine cannot draw
  CameraRenderer(const SimulationOptions& robot, std::vector<camera::Camera> cameras,
                 const RenderingOptions& options = {});
  CameraRenderer(CameraRenderer&&) noexcept;
  CameraRenderer& operator=(CameraRenderer&&) noexcept;
  ~CameraRenderer();

  /// What is drawn.
  [[nodiscard]] const SceneModel& model() const noexcept;
  /// The cameras as they are said to be.
  [[nodiscard]] const std::vector<camera::Camera>& cameras() const noexcept;
  /// The cameras as they are: others if the options have an error of the calibration.
  [[nodiscard]] const std::vector<camera::Camera>& true_cameras() const noexcept;
  [[nodiscard]] const RenderingOptions& options() const noexcept;

  /// Changes what the next images look like. New light, colours and noise take no time; a new error
  /// of the calibration takes some 0.1 s.
  /// @throws InvalidArgument
  void set_options(const RenderingOptions& options);

  /// Draws one image per camera, each into a span of `format.size()` bytes.
  ///
  /// `configuration` is MuJoCo's `qpos`, or `qpos` and then `qvel`, like
  /// `SimulatedRobot::configuration`. Without velocities there is no blur. `number` is that of the
  /// images: each has its own noise.
  /// @throws InvalidArgument if a size is wrong or a number is not finite
  void render(std::span<const double> configuration, std::uint64_t number,
              std::span<const std::span<std::byte>> images);

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::rendering
