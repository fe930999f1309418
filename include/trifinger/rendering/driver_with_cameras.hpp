// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "trifinger/base/text.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/rendering/camera_renderer.hpp"
#include "trifinger/rendering/vision.hpp"
#include "trifinger/sim/simulated_robot.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::rendering {

/// A simulated robot whose cameras are drawn in its own process, for simulations without real time.
/// Their images are the companion "cameras". With an `ObjectFinder`, the companion "object" has
/// what it finds in these images, instead of the true poses.
///
/// It is deterministic: options, states, random numbers and actions decide all images, bit for bit,
/// on one machine.
/// A session begins with images of its first state, at step -1. Images that are under way are no
/// part of the state that `SimulatedRobot::save` returns. Times of images are those of simulated
/// time, from step 0.
class DriverWithCameras final : public UntypedDriver {
 public:
  /// Fault code in addition to those of `SimulatedRobot`: drawing or finding has failed.
  static constexpr std::int32_t kBlind = 65;

  /// `robot` must outlive the driver. With `varies`, each session looks different; see
  /// `CaptureQueue::vary`.
  /// @throws InvalidArgument, Error that says what to install if this machine cannot draw
  DriverWithCameras(SimulatedRobot& robot, const std::vector<camera::Camera>& cameras,
                    const CaptureOptions& capture = {}, const RenderingOptions& rendering = {},
                    std::unique_ptr<ObjectFinder> finder = nullptr, bool varies = false);

  /// Lets other processes read the pixels: they are those of the robot `robot`. Without it only
  /// readers in this process find them. Call it before the first session.
  /// @throws InvalidArgument, SystemError, Error if another process writes images of this robot
  void share_images(const std::string& robot);

  /// What draws the images. Change its options between sessions.
  [[nodiscard]] CameraRenderer& renderer() noexcept { return pipeline_.renderer(); }

  [[nodiscard]] const RobotTypes& description() const noexcept override;
  [[nodiscard]] std::span<const CompanionDescription> companions() const noexcept override;
  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override;
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  void cut() noexcept override {}
  [[nodiscard]] bool get_companion_element(std::size_t index, TimeIndex time_index,
                                           void* element) noexcept override;
  [[nodiscard]] std::string_view fault_text(std::int32_t fault_code) const noexcept override;
  [[nodiscard]] std::string_view rejection_text() const noexcept override;

 private:
  void advance(TimeIndex time_index);
  [[nodiscard]] bool get_images(std::span<std::byte> element);
  [[nodiscard]] bool get_poses(TimeIndex time_index, std::byte* element);

  SimulatedRobot& robot_;
  VisionPipeline pipeline_;
  CaptureQueue captures_;
  std::vector<CompanionDescription> companions_;
  camera::ImageWriter writer_;
  std::vector<camera::Frame> frames_;
  bool has_new_images_{false};
  FixedText failure_;  // of a drawing, for the fault
  bool has_failed_{false};
};

/// A simulation with cameras, without real time: see `Simulation` and `DriverWithCameras`. Sessions
/// have the calibration, so `camera::CameraReader` reads the images.
///
///     rendering::SimulationWithCameras simulation(options, calibration);
///     auto robot = simulation.connect();
///     const camera::CameraReader cameras(robot);
///     const auto images = cameras.get_latest_at(t);
class SimulationWithCameras {
 public:
  /// @throws InvalidArgument, Error that says what to install if this machine cannot draw
  SimulationWithCameras(SimulationOptions options, const camera::Calibration& calibration,
                        const CaptureOptions& capture = {}, const RenderingOptions& rendering = {},
                        std::unique_ptr<ObjectFinder> finder = nullptr, SessionOptions session = {},
                        BackendOptions backend = {}, const std::string& name = {})
      : simulation_(std::move(options), with_document(std::move(session), calibration), backend,
                    name, [&](SimulatedRobot& robot) {
                      auto driver = std::make_unique<DriverWithCameras>(
                          robot, calibration.cameras, capture, rendering, std::move(finder));
                      driver_ = driver.get();
                      return driver;
                    }) {}

  [[nodiscard]] const Simulation& simulation() const noexcept { return simulation_; }
  [[nodiscard]] SimulatedRobot& robot() const noexcept { return simulation_.robot(); }
  /// What draws the images. Change its options between sessions.
  [[nodiscard]] CameraRenderer& renderer() const noexcept { return driver_->renderer(); }
  /// Controls the robot in a new session.
  /// @throws ControlHeld while another front-end controls it
  template <class R = TriFinger>
  [[nodiscard]] Frontend<R> connect(FrontendOptions options = {.strict = true}) const {
    return simulation_.connect<R>(options);
  }

 private:
  static SessionOptions with_document(SessionOptions session,
                                      const camera::Calibration& calibration) {
    session.documents.push_back(
        {.name = camera::kDocument, .media_type = "application/yaml", .text = calibration.text()});
    return session;
  }

  DriverWithCameras* driver_{nullptr};  // before the simulation, which sets it
  Simulation simulation_;
};

}  // namespace trifinger::rendering
