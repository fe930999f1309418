// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/rendering/driver_with_cameras.hpp"
#include "trifinger/rendering/options.hpp"
#include "trifinger/rendering/vision.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::rendering {

/// What images of simulated cameras look like: as their configuration says, or as `look` says with
/// the exposure and the gain of the configuration.
[[nodiscard]] RenderingOptions rendering_options(const camera::CameraOptions& cameras,
                                                 const std::optional<RenderingOptions>& look = {});

/// Finds the objects of a scene in the images of its cameras, with a `tracking::Tracker` for each.
/// There are poses only if all objects were found and are sure.
/// @throws InvalidArgument if an object has no faces with different colours, or the images none
[[nodiscard]] std::unique_ptr<ObjectFinder> make_object_finder(
    std::span<const ObjectDescription> objects, const std::vector<camera::Camera>& cameras);

/// Vision of a simulated robot without real time.
struct VisionOptions {
  std::vector<camera::Camera> cameras;
  CaptureOptions capture;
  RenderingOptions rendering;
  /// Light, colours, dust and noise differ in each session as `RenderingVariation` says.
  bool varies{false};
  bool finds_objects{false};  ///< A tracker finds the objects in the images.
};

/// Vision of a configured robot whose session is called `name`. Nothing if it has neither cameras
/// nor a tracker.
/// @throws InvalidArgument
[[nodiscard]] std::optional<VisionOptions> vision_options(
    const RobotConfig& config, const std::string& name,
    const std::optional<RenderingOptions>& look = {});

/// Age of the newest pose of an object just before the next one arrives [steps]. If it is older,
/// poses were lost, or the tracker was not sure since then.
[[nodiscard]] inline TimeIndex oldest_sure_age(const CaptureOptions& capture) {
  return capture.pose_delay.value_or(capture.delay) + capture.period - 1;
}
/// This age, for poses that come from a simulation and not from images.
[[nodiscard]] inline TimeIndex oldest_sure_age(const SimulationOptions& simulation) {
  return simulation.object_delay + simulation.object_period - 1;
}
/// This age, in a simulation of a configured robot without real time.
[[nodiscard]] TimeIndex oldest_sure_age(const RobotConfig& config);
/// This age, for a configured robot in another process. It is a period longer, because the poses of
/// other processes may be late.
[[nodiscard]] TimeIndex oldest_sure_age_elsewhere(const RobotConfig& config);

/// The vision pipeline of a robot with cameras, with a tracker if it has to find its objects.
/// @throws InvalidArgument, Error that says what to install if this machine cannot draw
[[nodiscard]] VisionPipeline make_vision_pipeline(const SimulationOptions& robot,
                                                  const VisionOptions& options);

/// The driver of a configured robot with cameras, for a simulation without real time: with its
/// cameras, if it has simulated ones, and with poses that a tracker has found, if its configuration
/// says so. Nothing if the robot has neither. `name` is that of the robot's session.
/// @throws InvalidArgument, Error that says what to install if this machine cannot draw
[[nodiscard]] std::unique_ptr<DriverWithCameras> make_driver_with_cameras(
    SimulatedRobot& robot, const RobotConfig& config, const std::string& name,
    const std::optional<RenderingOptions>& look = {});

/// A simulation of a configured robot in this process, without real time, with the cameras and the
/// tracker of its configuration. The same configuration gives the same observations, poses
/// and images, bit for bit.
/// @throws InvalidArgument, Error that says what to install if this machine cannot draw
[[nodiscard]] Simulation make_simulation(const RobotConfig& config,
                                         const std::optional<RenderingOptions>& look = {});

}  // namespace trifinger::rendering
