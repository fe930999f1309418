// SPDX-License-Identifier: BSD-3-Clause
#include "sim/robot_cameras.hpp"

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "sim/boards_config.hpp"
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

camera::Calibration calibration_of_file(const ModelFile& model) {
  const mjModel& mujoco = *model.mujoco();
  const SceneModel::Data data = model.make_data();
  model.reset(*data);
  mj_kinematics(&mujoco, data.get());
  mj_camlight(&mujoco, data.get());
  camera::Calibration calibration{.date = "the robot's file", .residual = 0, .cameras = {}};
  for (int i = 0; i < static_cast<int>(mujoco.ncam); ++i) {
    const bool stands =
        mujoco.body_weldid[mujoco.cam_bodyid[i]] == 0 && mujoco.cam_mode[i] == mjCAMLIGHT_FIXED;
    const bool has_usual_lens = mujoco.cam_projection[i] == mjPROJ_PERSPECTIVE &&
                                mujoco.cam_sensorsize[std::ptrdiff_t{2} * i] == 0.0F;
    const char* const name = mj_id2name(&mujoco, mjOBJ_CAMERA, i);
    if (!stands || !has_usual_lens || name == nullptr) continue;
    camera::Camera camera;
    camera.name = name;
    const int* const resolution = mujoco.cam_resolution + std::ptrdiff_t{2} * i;
    const bool has_resolution = resolution[0] > 1 && resolution[1] > 1;
    camera.format = {.width = has_resolution ? resolution[0] : kCameraImageSize,
                     .height = has_resolution ? resolution[1] : kCameraImageSize};
    const double half_view = mujoco.cam_fovy[i] * std::numbers::pi / 360;
    const double focal = 0.5 * camera.format.height / std::tan(half_view);
    camera.lens = {.fx = focal,
                   .fy = focal,
                   .cx = 0.5 * (camera.format.width - 1),
                   .cy = 0.5 * (camera.format.height - 1)};
    // MuJoCo's cameras look along -z, with y up.
    camera.pose.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
                               data->cam_xmat + std::ptrdiff_t{9} * i) *
                           Eigen::DiagonalMatrix<double, 3>(1, -1, -1);
    camera.pose.translation() = Eigen::Vector3d::Map(data->cam_xpos + std::ptrdiff_t{3} * i);
    calibration.cameras.push_back(std::move(camera));
  }
  return calibration;
}

camera::Calibration camera_calibration(const RobotConfig& config, const std::string& robot) {
  if (!config.cameras) {
    throw InvalidArgument("robot '" + robot +
                          "' has no cameras; its configuration needs a section 'cameras'");
  }
  return camera::resolve_calibration(*config.cameras, robot, [&] {
    const SimulationOptions& simulation = config.simulation;
    if (simulation.file == nullptr) return calibration_of_figures(simulation.description);
    camera::Calibration calibration = calibration_of_file(*simulation.file);
    if (calibration.cameras.empty()) {
      throw InvalidArgument("the file of robot '" + robot +
                            "' has no camera that has a name, stands still and is said by its "
                            "'fovy'; name a calibration (cameras.calibration)");
    }
    return calibration;
  });
}

bool has_tracked_objects(const RobotConfig& config) noexcept {
  const bool has_objects = !objects_of(config.simulation).empty();
  // Nobody else knows where objects are beside physical boards.
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
