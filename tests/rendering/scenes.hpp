// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "sim/robot_cameras.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/model/robot_model.hpp"
#include "trifinger/rendering/camera_renderer.hpp"

namespace trifinger::rendering {

// The cameras of a robot with images of this size and kind.
inline std::vector<camera::Camera> cameras(
    const RobotDescription& description, int factor = 1,
    camera::PixelFormat pixels = camera::PixelFormat::kBayerRg8) {
  std::vector<camera::Camera> cameras = calibration_of_figures(description).cameras;
  for (camera::Camera& camera : cameras) {
    camera = camera.reduced(factor);
    camera.format.pixels = pixels;
  }
  return cameras;
}

// MuJoCo's qpos: the robot in its initial pose, the only object here.
inline std::vector<double> configuration(
    const RobotDescription& description, const Eigen::Vector3d& position,
    const Eigen::Quaterniond& orientation = Eigen::Quaterniond::Identity()) {
  std::vector<double> values = RobotModel(description).initial_position();
  values.insert(values.end(), position.begin(), position.end());
  for (const double number : {orientation.w(), orientation.x(), orientation.y(), orientation.z()}) {
    values.push_back(number);
  }
  return values;
}

struct Images {
  std::vector<std::vector<std::byte>> bytes;

  friend bool operator==(const Images&, const Images&) = default;
};

inline Images render(CameraRenderer& renderer, std::span<const double> configuration,
                     std::uint64_t number = 0) {
  Images images;
  std::vector<std::span<std::byte>> spans;
  spans.reserve(renderer.cameras().size());
  for (const camera::Camera& camera : renderer.cameras()) {
    images.bytes.emplace_back(camera.format.size());
  }
  for (std::vector<std::byte>& bytes : images.bytes) spans.emplace_back(bytes);
  renderer.render(configuration, number, spans);
  return images;
}

// Without noise, and every surface has its own colour everywhere.
inline RenderingOptions plain() {
  return {.lamp_power = 0, .ambient_power = 1, .gloss = 0, .read_noise = 0, .shot_noise = 0};
}

}  // namespace trifinger::rendering
