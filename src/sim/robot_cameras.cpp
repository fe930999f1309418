// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/robot_cameras.hpp"

#include <Eigen/Geometry>
#include <numbers>
#include <variant>

#include "trifinger/base/error.hpp"
#include "trifinger/camera/images.hpp"

namespace trifinger {

camera::Calibration calibration_of_figures(const RobotDescription& description) {
  camera::Calibration calibration{.date = "published figures", .residual = 0, .cameras = {}};
  if (!description.cameras) return calibration;
  Eigen::Isometry3d platform = Eigen::Isometry3d::Identity();
  if (description.flipped) {
    platform.linear() =
        Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitY()).toRotationMatrix();
    platform.translation().z() = flip_height(description);
  }
  for (const CameraFigures& figures : camera_figures()) {
    camera::Camera camera;
    camera.name = figures.name;
    camera.format = {.width = kCameraImageSize, .height = kCameraImageSize};
    camera.lens = {.fx = figures.fx,
                   .fy = figures.fy,
                   .cx = figures.cx,
                   .cy = figures.cy,
                   .distortion = figures.distortion};
    camera.pose.linear() =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(figures.rotation.data());
    camera.pose.translation() =
        Eigen::Vector3d(figures.position[0], figures.position[1], figures.position[2]);
    camera.pose = platform * camera.pose;
    calibration.cameras.push_back(std::move(camera));
  }
  return calibration;
}

camera::Calibration camera_calibration(const RobotConfig& config, const std::string& robot) {
  if (!config.cameras) {
    throw InvalidArgument("robot '" + robot +
                          "' has no cameras; its configuration needs a section 'cameras'");
  }
  return camera::resolve_calibration(*config.cameras, robot, [&config] {
    return std::visit(
        [](const auto& simulation) { return calibration_of_figures(simulation.description); },
        config.simulation);
  });
}

bool has_tracked_objects(const RobotConfig& config) noexcept {
  const bool has_objects = std::visit(
      [](const auto& options) { return !options.description.objects.empty(); }, config.simulation);
  // Nobody else knows where objects are beside boards of metal.
  const bool is_hardware = config.boards && config.boards->bus == boards::BusKind::kSocketCan;
  return has_objects && config.cameras && (config.tracks_objects || is_hardware);
}

bool has_simulated_cameras(const RobotConfig& config) noexcept {
  return config.cameras && config.cameras->source == camera::SourceKind::kSimulated;
}

Document camera_document(const camera::Calibration& calibration) {
  return {.name = camera::kDocument, .media_type = "application/yaml", .text = calibration.text()};
}

}  // namespace trifinger
