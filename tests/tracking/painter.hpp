// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/tracking/tracked_object.hpp"

namespace trifinger::tracking::test {

// Three cameras around the table, with the lenses and at the poses of the robot's.
inline std::vector<camera::Camera> three_cameras(
    camera::PixelFormat pixels = camera::PixelFormat::kBayerRg8) {
  std::vector<camera::Camera> cameras;
  for (const CameraFigures& figures : camera_figures()) {
    camera::Camera camera;
    camera.name = figures.name;
    camera.format.pixels = pixels;
    camera.lens = {.fx = figures.fx,
                   .fy = figures.fy,
                   .cx = figures.cx,
                   .cy = figures.cy,
                   .distortion = figures.distortion};
    camera.pose.translation() << figures.position[0], figures.position[1], figures.position[2];
    camera.pose.linear() =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(figures.rotation.data());
    cameras.push_back(camera);
  }
  return cameras;
}

// Paints flat colours: what a camera sees of an object in front of a grey background.
class Painter {
 public:
  using Colour = Eigen::Vector3d;

  Colour light{1, 1, 1};
  Colour background{110, 112, 111};
  Colour rim{28, 28, 30};
  std::map<std::string, Colour> colours{{"red", {195, 48, 8}},       {"green", {143, 208, 90}},
                                        {"blue", {10, 40, 110}},     {"cyan", {100, 200, 195}},
                                        {"magenta", {164, 85, 164}}, {"yellow", {250, 225, 95}}};

  // `hull` is the whole object: what is not one of the coloured faces is rim.
  [[nodiscard]] std::vector<std::byte> paint(const camera::Camera& camera,
                                             const TrackedObject& object, const TrackedObject& hull,
                                             const Eigen::Isometry3d& pose) const {
    const camera::ImageFormat& format = camera.format;
    std::vector<std::byte> image(format.size());
    double radius = 0;
    for (const ColouredFace& face : hull.faces)
      for (const Eigen::Vector3d& corner : face.corners) radius = std::max(radius, corner.norm());
    const auto middle = camera.project(pose.translation());
    const double reach =
        1.5 * radius * camera.lens.fx / (camera.pose.translation() - pose.translation()).norm();
    const Eigen::Isometry3d to_object = pose.inverse() * camera.pose;
    for (int row = 0; row < format.height; ++row) {
      for (int column = 0; column < format.width; ++column) {
        const Eigen::Vector2d pixel(column, row);
        Colour colour = background;
        if (middle && (pixel - *middle).cwiseAbs().maxCoeff() < reach) {
          colour.setZero();
          for (const double x : {-0.25, 0.25})
            for (const double y : {-0.25, 0.25})
              colour += seen(camera, object, hull, to_object, pixel + Eigen::Vector2d(x, y)) / 4;
        }
        const auto level = [&](Eigen::Index channel) {
          return static_cast<std::byte>(static_cast<std::uint8_t>(
              std::clamp(light[channel] * colour[channel] + 0.5, 0.0, 255.0)));
        };
        const std::size_t place =
            static_cast<std::size_t>(row) * static_cast<std::size_t>(format.width) +
            static_cast<std::size_t>(column);
        if (format.pixels == camera::PixelFormat::kRgb8) {
          for (Eigen::Index i = 0; i < 3; ++i)
            image[3 * place + static_cast<std::size_t>(i)] = level(i);
        } else {
          image[place] = level(row % 2 + column % 2);
        }
      }
    }
    return image;
  }

 private:
  [[nodiscard]] Colour seen(const camera::Camera& camera, const TrackedObject& object,
                            const TrackedObject& hull, const Eigen::Isometry3d& to_object,
                            const Eigen::Vector2d& pixel) const {
    const Eigen::Vector3d ray =
        to_object.linear() * camera.lens.unproject(pixel).homogeneous().eval();
    const Eigen::Vector3d from = to_object.translation();
    for (const ColouredFace& face : object.faces)
      if (is_hit(face, from, ray)) return colours.at(face.colour);
    for (const ColouredFace& face : hull.faces)
      if (is_hit(face, from, ray)) return rim;
    return background;
  }

  static bool is_hit(const ColouredFace& face, const Eigen::Vector3d& from,
                     const Eigen::Vector3d& ray) {
    const auto& corners = face.corners;
    const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (normal.dot(ray) >= 0) return false;  // seen from inside
    const Eigen::Vector3d point = from + normal.dot(corners[0] - from) / normal.dot(ray) * ray;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Eigen::Vector3d along = corners[(i + 1) % corners.size()] - corners[i];
      if (normal.dot(along.cross(point - corners[i])) < 0) return false;
    }
    return true;
  }
};

// Images that a tracker takes, with their memory.
struct Pictures {
  std::vector<std::vector<std::byte>> images;

  [[nodiscard]] std::vector<std::span<const std::byte>> spans() const {
    return {images.begin(), images.end()};
  }
};

}  // namespace trifinger::tracking::test
