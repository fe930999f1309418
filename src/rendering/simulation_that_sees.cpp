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

class TrackerOfObjects final : public ObjectFinder {
 public:
  TrackerOfObjects(const RobotDescription& description, const std::vector<camera::Camera>& cameras)
      : guesses_(description.objects.size()) {
    for (const ObjectDescription& object : description.objects) {
      trackers_.emplace_back(cameras, tracking::tracked_object(object));
    }
  }

  bool find(std::span<const std::span<const std::byte>> images,
            std::span<ObjectPose> poses) override {
    bool are_all_sure = true;
    for (std::size_t i = 0; i < trackers_.size(); ++i) {
      std::optional<Eigen::Isometry3d>& guess = guesses_[i];
      const tracking::Estimate found = trackers_[i].track(images, guess ? &*guess : nullptr);
      if (found.is_sure()) {
        guess = found.pose;
        poses[i] = pose_of(found.pose);
      } else {
        guess.reset();
        are_all_sure = false;
      }
    }
    return are_all_sure;
  }
  void forget() override { std::ranges::fill(guesses_, std::nullopt); }

 private:
  std::vector<tracking::Tracker> trackers_;
  std::vector<std::optional<Eigen::Isometry3d>> guesses_;
};

}  // namespace

RenderingOptions rendering_options(const camera::CameraOptions& cameras,
                                   RenderingOptions rendering) {
  rendering.exposure = cameras.exposure;
  rendering.gain *= std::pow(10, cameras.gain / 20);
  return rendering;
}

std::unique_ptr<ObjectFinder> make_object_finder(const RobotDescription& description,
                                                 const std::vector<camera::Camera>& cameras) {
  return std::make_unique<TrackerOfObjects>(description, cameras);
}

template <class R>
std::unique_ptr<DriverWithCameras<R>> make_driver_with_cameras(SimulatedRobot<R>& robot,
                                                               const RobotConfig& config,
                                                               const std::string& name,
                                                               const RenderingOptions& rendering) {
  if (!has_simulated_cameras(config)) return nullptr;
  const Nanoseconds step = robot.options().period;
  const CaptureOptions capture{.period = std::max<TimeIndex>(config.cameras->period / step, 1),
                               .delay = config.cameras->simulated.delay / step};
  const std::vector<camera::Camera> cameras = camera_calibration(config, name).cameras;
  RenderingOptions look = rendering_options(*config.cameras, rendering);
  look.seed += robot.options().seed;
  return std::make_unique<DriverWithCameras<R>>(
      robot, cameras, capture, look,
      config.tracks_objects ? make_object_finder(robot.options().description, cameras) : nullptr);
}

template <class R>
Simulation<R> make_simulation(const RobotConfig& config, const RenderingOptions& rendering) {
  SessionOptions session = config.session;
  if (has_simulated_cameras(config)) {
    session.documents.push_back(camera_document(camera_calibration(config, config.name)));
  }
  return Simulation<R>(
      std::get<SimulationOptions<R>>(config.simulation),
      [&](SimulatedRobot<R>& robot) {
        return make_driver_with_cameras(robot, config, config.name, rendering);
      },
      std::move(session), config.backend, config.name);
}

template std::unique_ptr<DriverWithCameras<TriFinger>> make_driver_with_cameras(
    SimulatedRobot<TriFinger>&, const RobotConfig&, const std::string&, const RenderingOptions&);
template std::unique_ptr<DriverWithCameras<Finger>> make_driver_with_cameras(
    SimulatedRobot<Finger>&, const RobotConfig&, const std::string&, const RenderingOptions&);
template Simulation<TriFinger> make_simulation(const RobotConfig&, const RenderingOptions&);
template Simulation<Finger> make_simulation(const RobotConfig&, const RenderingOptions&);

}  // namespace trifinger::rendering
