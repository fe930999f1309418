// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/simulation_with_cameras.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

#include "sim/robot_cameras.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/tracking/tracked_object.hpp"
#include "trifinger/tracking/tracker.hpp"

namespace trifinger::rendering {
namespace {

ObjectPose pose_of(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond turn(pose.linear());
  const Eigen::Vector3d& place = pose.translation();
  return {.position = {place.x(), place.y(), place.z()},
          .orientation = {turn.w(), turn.x(), turn.y(), turn.z()}};
}

Eigen::Isometry3d transform_of(const ObjectPose& pose) {
  const auto& [w, x, y, z] = pose.orientation;
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  transform.linear() = Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
  transform.translation() = Eigen::Vector3d::Map(pose.position.data());
  return transform;
}

CaptureOptions capture_options(const camera::CameraOptions& cameras,
                               const SimulationOptions& simulation) {
  const TimeIndex delay = cameras.simulated.delay / simulation.period;
  return {.period = std::max<TimeIndex>(cameras.period / simulation.period, 1),
          .delay = delay,
          .pose_delay = std::max(delay, simulation.object_delay)};
}

class TrackerOfObjects final : public ObjectFinder {
 public:
  TrackerOfObjects(std::span<const ObjectDescription> objects,
                   const std::vector<camera::Camera>& cameras) {
    for (const ObjectDescription& object : objects) {
      tracking::TrackedObject tracked = tracking::tracked_object(object);
      if (const auto warning = tracking::look_alike_warning(tracked))
        throw InvalidArgument(*warning);
      trackers_.emplace_back(cameras, std::move(tracked));
    }
  }

  void find(std::span<const std::span<const std::byte>> images,
            std::span<std::optional<ObjectPose>> poses) override {
    for (std::size_t i = 0; i < trackers_.size(); ++i) {
      std::optional<Eigen::Isometry3d> guess;
      if (poses[i]) guess = transform_of(*poses[i]);
      const tracking::Estimate found = trackers_[i].track(images, guess ? &*guess : nullptr);
      poses[i].reset();
      if (found.is_sure()) poses[i] = pose_of(found.pose);
    }
  }

 private:
  std::vector<tracking::Tracker> trackers_;
};

}  // namespace

RenderingOptions rendering_options(const camera::CameraOptions& cameras,
                                   const std::optional<RenderingOptions>& look) {
  RenderingOptions rendering = look.value_or(cameras.simulated.look);
  rendering.exposure = cameras.exposure;
  rendering.gain *= std::pow(10, cameras.gain / 20);
  return rendering;
}

std::unique_ptr<ObjectFinder> make_object_finder(std::span<const ObjectDescription> objects,
                                                 const std::vector<camera::Camera>& cameras) {
  return std::make_unique<TrackerOfObjects>(objects, cameras);
}

std::optional<VisionOptions> vision_options(const RobotConfig& config, const std::string& name,
                                            const std::optional<RenderingOptions>& look) {
  if (!has_simulated_cameras(config)) return std::nullopt;
  const SimulationOptions& simulation = config.simulation;
  VisionOptions options{.cameras = camera_calibration(config, name).cameras,
                        .capture = capture_options(*config.cameras, simulation),
                        .rendering = rendering_options(*config.cameras, look),
                        .varies = config.cameras->simulated.varies,
                        .finds_objects = config.tracks_objects && !objects_of(simulation).empty()};
  options.rendering.seed += simulation.seed;
  options.rendering.calibration_seed += simulation.seed;
  return options;
}

TimeIndex oldest_sure_age(const RobotConfig& config) {
  const SimulationOptions& simulation = config.simulation;
  return config.tracks_objects ? oldest_sure_age(capture_options(*config.cameras, simulation))
                               : oldest_sure_age(simulation);
}

TimeIndex oldest_sure_age_elsewhere(const RobotConfig& config) {
  const SimulationOptions& simulation = config.simulation;
  if (!has_tracked_objects(config)) return oldest_sure_age(simulation) + simulation.object_period;
  const CaptureOptions capture = capture_options(*config.cameras, simulation);
  return oldest_sure_age(capture) + capture.period;
}

VisionPipeline make_vision_pipeline(const SimulationOptions& robot, const VisionOptions& options) {
  return {robot, options.cameras, options.rendering,
          options.finds_objects ? make_object_finder(objects_of(robot), options.cameras) : nullptr};
}

std::unique_ptr<DriverWithCameras> make_driver_with_cameras(
    SimulatedRobot& robot, const RobotConfig& config, const std::string& name,
    const std::optional<RenderingOptions>& look) {
  const std::optional<VisionOptions> vision = vision_options(config, name, look);
  if (!vision) return nullptr;
  return std::make_unique<DriverWithCameras>(
      robot, vision->cameras, vision->capture, vision->rendering,
      vision->finds_objects ? make_object_finder(objects_of(robot.options()), vision->cameras)
                            : nullptr,
      vision->varies);
}

Simulation make_simulation(const RobotConfig& config, const std::optional<RenderingOptions>& look) {
  SessionOptions session = config.session;
  if (has_simulated_cameras(config)) {
    session.documents.push_back(camera_document(camera_calibration(config, config.name)));
  }
  return Simulation(config.simulation, std::move(session), config.backend, config.name,
                    [&](SimulatedRobot& robot) {
                      return make_driver_with_cameras(robot, config, config.name, look);
                    });
}

}  // namespace trifinger::rendering
