// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <utility>
#include <vector>

#include "colour_table.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/tracking/tracked_object.hpp"

namespace trifinger::tracking::detail {

constexpr std::size_t kMaxCameras = 8;

// A point of the world in an image, and how it moves when the point moves.
struct Projected {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> slope;
};

// A calibrated camera with the image that it took.
struct View {
  // `most` has for each colour the number of blocks that the object can show of it.
  View(const camera::Camera& camera, std::vector<double> most)
      : lens(camera.lens),
        to_camera(camera.pose.linear().transpose()),
        position(camera.pose.translation()),
        image(camera.format, std::move(most)) {}

  [[nodiscard]] Eigen::Vector3d seen(const Eigen::Vector3d& point) const noexcept {
    return to_camera * (point - position);
  }
  // `point` must be in front of the camera.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& point) const noexcept {
    return lens.project(seen(point));
  }
  [[nodiscard]] Projected project_with_slope(const Eigen::Vector3d& point) const noexcept {
    const Eigen::Vector3d at = seen(point);
    const Eigen::Vector2d ray = at.head<2>() / at.z();
    Eigen::Matrix<double, 2, 3> pinhole;
    pinhole << 1, 0, -ray.x(), 0, 1, -ray.y();
    return {lens.project(ray), lens.derivative(ray) / at.z() * pinhole * to_camera};
  }

  camera::Lens lens;
  Eigen::Matrix3d to_camera;
  Eigen::Vector3d position;
  LabelledImage image;
};

// A face of the object.
struct Face {
  Label label;
  std::vector<Eigen::Vector3d> corners;
  // For each edge, from its corner on: the face beyond it that has the same colour, so that no
  // image shows the edge between them. Negative if there is none.
  std::vector<int> same_beyond;
  // For each edge, the face that lies where it looks to: the side of the object that is there.
  std::vector<std::size_t> sides;
  Eigen::Vector3d normal;
  Eigen::Vector3d centre;
  double area;
  std::vector<Eigen::Vector3d> samples;  // points spread evenly over the inner part
};

// A turn that brings all faces to where faces are, other colours aside.
struct Turn {
  Eigen::Matrix3d rotation;
  std::vector<std::size_t> order;  // for each face, the face that comes to its place
};

// What the object looks like.
struct Shape {
  // Labels are places in `colours`.
  Shape(const TrackedObject& object, const std::vector<std::string>& colours);

  std::vector<Face> faces;
  std::vector<Turn> turns;  // all but the one that leaves everything as it is
  bool has_rims;
  double radius{0};      // of the ball around the centre that holds the object
  double mean_width{0};  // side of the square with the mean area of its silhouettes
};

// How far a face leans: 1 if it faces the camera, 0 or less if it cannot be seen.
inline double facing(const View& view, const Eigen::Isometry3d& pose, const Face& face) noexcept {
  const Eigen::Vector3d to_camera = view.position - pose * face.centre;
  return (pose.linear() * face.normal).dot(to_camera) / to_camera.norm();
}

}  // namespace trifinger::tracking::detail
