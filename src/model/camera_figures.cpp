// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Core>
#include <Eigen/SVD>
#include <cmath>

#include "trifinger/model/robot_description.hpp"

namespace trifinger {
namespace {

// Rows of the transform from world to camera, as the original simulation's calibration stores it.
// It is an average of several robots, so its rotation is orthonormal to 1e-5 only.
struct Calibration {
  std::string_view name;
  double world_to_camera[3][4];
  double fx, fy, cx, cy;
  std::array<double, 5> distortion;
};

constexpr Calibration kCalibrations[] = {
    {.name = "camera60",
     .world_to_camera = {{-0.701913, 0.712235, -0.004805, 0.002253},
                         {0.534464, 0.522232, -0.664539, -0.003275},
                         {-0.470798, -0.469022, -0.747232, 0.523888}},
     .fx = 587.298,
     .fy = 591.540,
     .cx = 291.286,
     .cy = 277.456,
     .distortion = {-0.23805, 0.10826, -0.00246, 0.00005, -0.02723}},
    {.name = "camera180",
     .world_to_camera = {{0.999990, 0.001198, 0.000930, 0.001583},
                         {0.001505, -0.860397, -0.509608, 0.005908},
                         {0.000194, 0.509606, -0.860397, 0.533650}},
     .fx = 585.064,
     .fy = 587.965,
     .cx = 281.135,
     .cy = 278.415,
     .distortion = {-0.23739, 0.14669, -0.00336, 0.00022, -0.13565}},
    {.name = "camera300",
     .world_to_camera = {{-0.713377, -0.700619, -0.014564, 0.000684},
                         {-0.519624, 0.542804, -0.659800, -0.007555},
                         {0.470179, -0.463123, -0.751292, 0.524410}},
     .fx = 586.437,
     .fy = 590.807,
     .cx = 288.080,
     .cy = 284.183,
     .distortion = {-0.23391, 0.09394, -0.00279, -0.00007, -0.01742}},
};

CameraFigures from_calibration(const Calibration& calibration) {
  Eigen::Matrix3d stored;
  Eigen::Vector3d translation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      stored(row, column) = calibration.world_to_camera[row][column];
    translation[row] = calibration.world_to_camera[row][3];
  }
  // The nearest rotation, by singular values.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(stored, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d to_world = (svd.matrixU() * svd.matrixV().transpose()).transpose();
  const Eigen::Vector3d position = -(to_world * translation);

  CameraFigures camera{.name = calibration.name,
                       .position = {position.x(), position.y(), position.z()},
                       .rotation = {},
                       .fx = calibration.fx,
                       .fy = calibration.fy,
                       .cx = calibration.cx,
                       .cy = calibration.cy,
                       .distortion = calibration.distortion,
                       .vertical_view = 2 * std::atan(kCameraImageSize / 2.0 / calibration.fy)};
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.rotation.data()) = to_world;
  return camera;
}

}  // namespace

const std::array<CameraFigures, 3>& camera_figures() {
  static const std::array<CameraFigures, 3> cameras{from_calibration(kCalibrations[0]),
                                                    from_calibration(kCalibrations[1]),
                                                    from_calibration(kCalibrations[2])};
  return cameras;
}

}  // namespace trifinger
