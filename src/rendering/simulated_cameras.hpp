// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/camera/source.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/rendering/camera_renderer.hpp"

namespace trifinger::rendering {

/// The cameras of a simulated robot that runs in another process, or elsewhere in this one: draws
/// what its companion "scene" says.
///
/// The robot need not run yet and may be started again. While it holds its pose before step 0, the
/// cameras go on seeing it. After its end there are no images until its next session. If drawing
/// takes longer than a period, images are left out: their numbers have gaps.
class SimulatedCameras final : public camera::Source {
 public:
  /// Draws an image every `period` at most, as `simulation` says, of the robot
  /// `robot`.
  /// @throws InvalidArgument, Error that says what to install if this machine cannot draw
  SimulatedCameras(std::string robot, const SimulationOptions& simulation,
                   std::vector<camera::Camera> cameras, Nanoseconds period,
                   const RenderingOptions& options = {});

  [[nodiscard]] const std::vector<std::string>& names() const noexcept override { return names_; }
  [[nodiscard]] const std::vector<camera::ImageFormat>& formats() const noexcept override {
    return formats_;
  }
  /// The time of a frame is that of the robot's step that it shows.
  [[nodiscard]] bool grab(std::span<const std::span<std::byte>> images,
                          std::span<camera::Frame> frames, Timeout timeout) override;

  /// Images that were left out because drawing took too long.
  [[nodiscard]] std::int64_t num_dropped() const noexcept { return num_dropped_; }

 private:
  // What is drawn next, and when it was so.
  struct Scene {
    Instant time{};
    bool is_before_step_0{false};
    std::vector<double> configuration;
  };

  [[nodiscard]] bool find_robot(const Deadline& deadline);
  [[nodiscard]] bool find_scene(const Deadline& deadline);
  [[nodiscard]] bool goes_on();
  [[nodiscard]] bool is_due() const noexcept;
  [[nodiscard]] bool read_newest();

  std::string robot_;
  CameraRenderer renderer_;
  Nanoseconds period_;
  std::vector<std::string> names_;
  std::vector<camera::ImageFormat> formats_;
  std::optional<UntypedFrontend> companion_;
  ElementDescription scene_element_;
  std::vector<std::byte> element_;
  TimeIndex next_{0};  // element of the companion
  Scene scene_;
  std::optional<Instant> last_;  // time of the last image of this session
  std::int64_t number_{-1};
  std::int64_t num_dropped_{0};
};

}  // namespace trifinger::rendering
