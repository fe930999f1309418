// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/simulation_that_sees.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <variant>

#include "trifinger/base/error.hpp"
#include "trifinger/sim/robot_cameras.hpp"
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

template <class R>
CaptureOptions capture_options(const camera::CameraOptions& cameras,
                               const SimulationOptions<R>& simulation) {
  const TimeIndex delay = cameras.simulated.delay / simulation.period;
  return {.period = std::max<TimeIndex>(cameras.period / simulation.period, 1),
          .delay = delay,
          .pose_delay = std::max(delay, simulation.object_delay)};
}

class TrackerOfObjects final : public ObjectFinder {
 public:
  TrackerOfObjects(const RobotDescription& description,
                   const std::vector<camera::Camera>& cameras) {
    for (const ObjectDescription& object : description.objects) {
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

std::unique_ptr<ObjectFinder> make_object_finder(const RobotDescription& description,
                                                 const std::vector<camera::Camera>& cameras) {
  return std::make_unique<TrackerOfObjects>(description, cameras);
}

std::optional<SightOptions> sight_options(const RobotConfig& config, const std::string& name,
                                          const std::optional<RenderingOptions>& look) {
  if (!has_simulated_cameras(config)) return std::nullopt;
  return std::visit(
      [&](const auto& simulation) {
        SightOptions options{
            .cameras = camera_calibration(config, name).cameras,
            .capture = capture_options(*config.cameras, simulation),
            .rendering = rendering_options(*config.cameras, look),
            .varies = config.cameras->simulated.varies,
            .finds_objects = config.tracks_objects && !simulation.description.objects.empty()};
        options.rendering.seed += simulation.seed;
        options.rendering.calibration_seed += simulation.seed;
        return options;
      },
      config.simulation);
}

TimeIndex oldest_sure_age(const RobotConfig& config) {
  return std::visit(
      [&config](const auto& simulation) {
        return config.tracks_objects ? oldest_sure_age(capture_options(*config.cameras, simulation))
                                     : oldest_sure_age(simulation);
      },
      config.simulation);
}

TimeIndex oldest_sure_age_elsewhere(const RobotConfig& config) {
  return std::visit(
      [&config](const auto& simulation) {
        if (!has_tracked_objects(config)) {
          return oldest_sure_age(simulation) + simulation.object_period;
        }
        const CaptureOptions capture = capture_options(*config.cameras, simulation);
        return oldest_sure_age(capture) + capture.period;
      },
      config.simulation);
}

Eyes make_eyes(const RobotDescription& description, const SightOptions& options) {
  return {description, options.cameras, options.rendering,
          options.finds_objects ? make_object_finder(description, options.cameras) : nullptr};
}

template <class R>
std::unique_ptr<DriverWithCameras<R>> make_driver_with_cameras(
    SimulatedRobot<R>& robot, const RobotConfig& config, const std::string& name,
    const std::optional<RenderingOptions>& look) {
  const std::optional<SightOptions> sight = sight_options(config, name, look);
  if (!sight) return nullptr;
  const RobotDescription& description = robot.options().description;
  return std::make_unique<DriverWithCameras<R>>(
      robot, sight->cameras, sight->capture, sight->rendering,
      sight->finds_objects ? make_object_finder(description, sight->cameras) : nullptr,
      sight->varies);
}

template <class R>
Simulation<R> make_simulation(const RobotConfig& config,
                              const std::optional<RenderingOptions>& look) {
  SessionOptions session = config.session;
  if (has_simulated_cameras(config)) {
    session.documents.push_back(camera_document(camera_calibration(config, config.name)));
  }
  return Simulation<R>(
      std::get<SimulationOptions<R>>(config.simulation),
      [&](SimulatedRobot<R>& robot) {
        return make_driver_with_cameras(robot, config, config.name, look);
      },
      std::move(session), config.backend, config.name);
}

template std::unique_ptr<DriverWithCameras<TriFinger>> make_driver_with_cameras(
    SimulatedRobot<TriFinger>&, const RobotConfig&, const std::string&,
    const std::optional<RenderingOptions>&);
template std::unique_ptr<DriverWithCameras<Finger>> make_driver_with_cameras(
    SimulatedRobot<Finger>&, const RobotConfig&, const std::string&,
    const std::optional<RenderingOptions>&);
template Simulation<TriFinger> make_simulation(const RobotConfig&,
                                               const std::optional<RenderingOptions>&);
template Simulation<Finger> make_simulation(const RobotConfig&,
                                            const std::optional<RenderingOptions>&);

}  // namespace trifinger::rendering
