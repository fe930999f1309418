// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "view.hpp"

namespace trifinger::tracking::detail {
namespace {

using trifinger::detail::text_of;

// Points inside a convex polygon, seen from its centre: on rings of growing size. The outermost
// ring stays away from the edges, where blocks of pixels show two colours.
std::vector<Eigen::Vector3d> spread(const std::vector<Eigen::Vector3d>& corners,
                                    const Eigen::Vector3d& centre) {
  constexpr double kRings[] = {0.30, 0.58, 0.84};
  constexpr int kOnEdge[] = {2, 3, 4};
  std::vector<Eigen::Vector3d> points{centre};
  for (std::size_t ring = 0; ring < 3; ++ring) {
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Eigen::Vector3d& from = corners[i];
      const Eigen::Vector3d& to = corners[(i + 1) % corners.size()];
      for (int k = 0; k < kOnEdge[ring]; ++k) {
        const Eigen::Vector3d on_edge = from + (to - from) * k / kOnEdge[ring];
        points.emplace_back(centre + kRings[ring] * (on_edge - centre));
      }
    }
  }
  return points;
}

// The axes of a face: its normal, and the direction to one of its corners.
Eigen::Matrix3d axes(const Face& face, std::size_t corner) {
  Eigen::Matrix3d axes;
  axes.col(0) = face.normal;
  axes.col(1) = (face.corners[corner] - face.centre).normalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

// The faces that a turn brings to the place of each face; empty if it brings none to one of them.
std::vector<std::size_t> turned(const std::vector<Face>& faces, const Eigen::Matrix3d& turn,
                                double tolerance) {
  std::vector<std::size_t> order(faces.size(), faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const Eigen::Vector3d centre = turn * faces[i].centre;
    const Eigen::Vector3d normal = turn * faces[i].normal;
    const auto place = std::ranges::find_if(faces, [&](const Face& face) {
      return (face.centre - centre).norm() < tolerance && face.normal.dot(normal) > 1 - 1e-6 &&
             std::ranges::all_of(faces[i].corners, [&](const Eigen::Vector3d& corner) {
               return std::ranges::any_of(face.corners, [&](const Eigen::Vector3d& other) {
                 return (turn * corner - other).norm() < tolerance;
               });
             });
    });
    if (place == faces.end()) return {};
    order[static_cast<std::size_t>(place - faces.begin())] = i;
  }
  return order;
}

std::vector<Turn> all_turns(const std::vector<Face>& faces, double tolerance) {
  std::vector<Turn> turns;
  const Eigen::Matrix3d from = axes(faces[0], 0);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i].corners.size() != faces[0].corners.size()) continue;
    for (std::size_t k = 0; k < faces[i].corners.size(); ++k) {
      if (i == 0 && k == 0) continue;  // stays as it is
      const Eigen::Matrix3d rotation = axes(faces[i], k) * from.transpose();
      auto order = turned(faces, rotation, tolerance);
      if (!order.empty()) turns.push_back({rotation, std::move(order)});
    }
  }
  return turns;
}

}  // namespace

Shape::Shape(const TrackedObject& object, const std::vector<std::string>& colours)
    : has_rims(object.rim > 0) {
  if (object.faces.empty()) {
    throw InvalidArgument(text_of("'", object.name, "' has no faces, must have at least one"));
  }
  double surface = 0;
  for (const ColouredFace& given : object.faces) {
    if (given.corners.size() < 3) {
      throw InvalidArgument(text_of("a face of '", object.name, "' has ", given.corners.size(),
                                    " corners, must have at least 3"));
    }
    Face face{
        .label = static_cast<Label>(std::ranges::find(colours, given.colour) - colours.begin()),
        .corners = given.corners,
        .same_beyond = std::vector<int>(given.corners.size(), -1),
        .sides = std::vector<std::size_t>(given.corners.size(), 0),
        .normal = Eigen::Vector3d::Zero(),
        .centre = Eigen::Vector3d::Zero(),
        .area = 0,
        .samples = {}};
    Eigen::Vector3d twice_area = Eigen::Vector3d::Zero();
    for (std::size_t i = 1; i + 1 < face.corners.size(); ++i) {
      const Eigen::Vector3d cross =
          (face.corners[i] - face.corners[0]).cross(face.corners[i + 1] - face.corners[0]);
      twice_area += cross;
      face.centre += cross.norm() / 3 * (face.corners[0] + face.corners[i] + face.corners[i + 1]);
    }
    if (!(twice_area.norm() > 0)) {
      throw InvalidArgument(text_of("a face of '", object.name, "' has no area"));
    }
    face.normal = twice_area.normalized();
    face.centre /= twice_area.norm();
    face.area = twice_area.norm() / 2;
    face.samples = spread(face.corners, face.centre);
    for (const Eigen::Vector3d& corner : face.corners) radius = std::max(radius, corner.norm());
    surface += face.area;
    faces.push_back(std::move(face));
  }
  // The mean silhouette of a convex body has a quarter of its surface (Cauchy).
  mean_width = std::sqrt(surface / 4);
  const double tolerance = 1e-4 * radius;
  turns = all_turns(faces, 10 * tolerance);
  for (std::size_t a = 0; a < faces.size(); ++a) {
    for (std::size_t i = 0; i < faces[a].corners.size(); ++i) {
      const Eigen::Vector3d& from = faces[a].corners[i];
      const Eigen::Vector3d& to = faces[a].corners[(i + 1) % faces[a].corners.size()];
      const Eigen::Vector3d outwards = (to - from).cross(faces[a].normal);
      const auto beyond = std::ranges::max_element(
          faces, {}, [&](const Face& face) { return face.normal.dot(outwards); });
      faces[a].sides[i] = static_cast<std::size_t>(beyond - faces.begin());
      for (std::size_t b = 0; b < faces.size(); ++b) {
        const auto has = [&](const Eigen::Vector3d& point) {
          return std::ranges::any_of(faces[b].corners, [&](const Eigen::Vector3d& corner) {
            return (corner - point).norm() < tolerance;
          });
        };
        if (b != a && faces[b].label == faces[a].label && has(from) && has(to)) {
          faces[a].same_beyond[i] = static_cast<int>(b);
        }
      }
    }
  }
}

}  // namespace trifinger::tracking::detail

namespace trifinger::tracking {

int look_alikes(const TrackedObject& object) {
  std::vector<std::string> colours;
  for (const ColouredFace& face : object.faces) {
    if (std::ranges::find(colours, face.colour) == colours.end()) colours.push_back(face.colour);
  }
  const detail::Shape shape(object, colours);
  return static_cast<int>(std::ranges::count_if(shape.turns, [&](const auto& turn) {
    for (std::size_t i = 0; i < turn.order.size(); ++i) {
      if (shape.faces[turn.order[i]].label != shape.faces[i].label) return false;
    }
    return true;
  }));
}

std::optional<std::string> look_alike_warning(const TrackedObject& object) {
  const int count = look_alikes(object);
  if (count == 0) return std::nullopt;
  return trifinger::detail::text_of(
      object.name, " looks the same after ", count, " different turn", count == 1 ? "" : "s",
      ", so no pose of it will be sure: give its faces other 'colours' in the configuration");
}

}  // namespace trifinger::tracking
