// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/cameras_of.hpp"

#include <Eigen/Geometry>

namespace trifinger::rendering {

camera::Calibration cameras_of(const RobotDescription& description) {
  camera::Calibration calibration;
  if (!description.cameras) return calibration;
  Eigen::Isometry3d platform = Eigen::Isometry3d::Identity();
  if (description.flipped) {
    // Half a turn about the y axis.
    platform.linear() = Eigen::Vector3d(-1, 1, -1).asDiagonal();
    platform.translation().z() = flip_height(description);
  }
  for (const CameraFigures& figures : camera_figures()) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(figures.rotation.data());
    pose.translation() = Eigen::Vector3d(figures.position.data());
    calibration.cameras.push_back(
        {.name = std::string(figures.name),
         .format = {.width = kCameraImageSize, .height = kCameraImageSize},
         .lens = {.fx = figures.fx,
                  .fy = figures.fy,
                  .cx = figures.cx,
                  .cy = figures.cy,
                  .distortion = figures.distortion},
         .pose = platform * pose});
  }
  return calibration;
}

}  // namespace trifinger::rendering
