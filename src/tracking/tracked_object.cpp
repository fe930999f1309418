// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/tracking/tracked_object.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::tracking {
namespace {

using trifinger::detail::text_of;
using Triangle = std::array<int, 3>;

// Triangles in one plane and of one colour.
struct Facet {
  Eigen::Vector3d normal;
  double height;
  std::string colour;
  std::vector<Triangle> triangles;
};

// The outline of a facet, anticlockwise: the edges that belong to one triangle only.
std::vector<Eigen::Vector3d> outline(const Facet& facet,
                                     const std::vector<Eigen::Vector3d>& vertices) {
  std::map<int, int> next;
  for (const Triangle& triangle : facet.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const int from = triangle[i];
      const int to = triangle[(i + 1) % 3];
      const bool is_inner = std::ranges::any_of(facet.triangles, [&](const Triangle& other) {
        for (std::size_t j = 0; j < 3; ++j) {
          if (other[j] == to && other[(j + 1) % 3] == from) return true;
        }
        return false;
      });
      if (!is_inner) next[from] = to;
    }
  }
  std::vector<Eigen::Vector3d> corners;
  int vertex = next.begin()->first;
  for (std::size_t i = 0; i < next.size(); ++i) {
    corners.push_back(vertices[static_cast<std::size_t>(vertex)]);
    const auto step = next.find(vertex);
    if (step == next.end()) break;
    vertex = step->second;
  }
  return corners;
}

}  // namespace

TrackedObject coloured_box(std::string name, const Eigen::Vector3d& size, const BoxColours& colours,
                           double rim) {
  if (!(size.minCoeff() > 0) || !(rim >= 0) || !(2 * rim < size.minCoeff())) {
    throw InvalidArgument(text_of("a box of ", size.x(), " x ", size.y(), " x ", size.z(),
                                  " m with a rim of ", rim,
                                  " m has no faces; sizes must be positive, and the rim less than "
                                  "half of the smallest one"));
  }
  struct Side {
    Eigen::Index axis;
    double sign;
  };
  constexpr Side kSides[] = {{0, 1}, {1, 1}, {2, 1}, {2, -1}, {0, -1}, {1, -1}};
  TrackedObject object{.name = std::move(name), .faces = {}, .rim = rim};
  const Eigen::Vector3d half = size / 2;
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const auto [axis, sign] = kSides[i];
    const Eigen::Index u = (axis + 1) % 3;
    const Eigen::Index v = (axis + 2) % 3;
    ColouredFace face{.colour = colours[i], .corners = {}};
    // Anticlockwise from outside: with the axes u, v for the positive side, against them otherwise.
    constexpr double kAround[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (std::size_t k = 0; k < 4; ++k) {
      const auto& corner = kAround[sign > 0 ? k : 3 - k];
      Eigen::Vector3d point;
      point[axis] = sign * half[axis];
      point[u] = corner[0] * (half[u] - rim);
      point[v] = corner[1] * (half[v] - rim);
      face.corners.push_back(point);
    }
    object.faces.push_back(std::move(face));
  }
  return object;
}

TrackedObject tracked_object(const ObjectDescription& object) {
  if (object.shape != ObjectShape::kBox) {
    throw InvalidArgument(
        text_of("'", object.name, "' is a ", object.shape == ObjectShape::kBall ? "ball" : "stick",
                ", which looks alike from several sides; only boxes with coloured "
                "faces can be tracked"));
  }
  const auto& [x, y, z] = object.size;
  return coloured_box(object.name, {x, y, z}, object.colours, box_rim(object));
}

TrackedObject coloured_mesh(std::string name, const std::vector<Eigen::Vector3d>& vertices,
                            const std::vector<std::array<int, 3>>& triangles,
                            const std::vector<std::string>& colours) {
  if (triangles.empty() || colours.size() != triangles.size()) {
    throw InvalidArgument(text_of("a mesh of ", triangles.size(), " triangles has ", colours.size(),
                                  " colours, must have one for each triangle"));
  }
  double radius = 0;
  for (const Eigen::Vector3d& vertex : vertices) radius = std::max(radius, vertex.norm());
  const double tolerance = 1e-4 * radius;
  std::vector<Facet> facets;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    std::array<Eigen::Vector3d, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const int vertex = triangles[i][k];
      if (vertex < 0 || static_cast<std::size_t>(vertex) >= vertices.size()) {
        throw InvalidArgument(
            text_of("triangle ", i, " has vertex ", vertex, "; the mesh has ", vertices.size()));
      }
      corners[k] = vertices[static_cast<std::size_t>(vertex)];
    }
    const Eigen::Vector3d cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (!(cross.norm() > tolerance * tolerance)) {
      throw InvalidArgument(text_of("triangle ", i, " of the mesh has no area"));
    }
    const Eigen::Vector3d normal = cross.normalized();
    const double height = normal.dot(corners[0]);
    for (const Eigen::Vector3d& vertex : vertices) {
      if (normal.dot(vertex) > height + tolerance) {
        throw InvalidArgument(text_of("a vertex lies in front of triangle ", i,
                                      ": only convex meshes can be tracked"));
      }
    }
    const auto same = std::ranges::find_if(facets, [&](const Facet& facet) {
      return facet.colour == colours[i] && facet.normal.dot(normal) > 1 - 1e-6 &&
             std::abs(facet.height - height) < tolerance;
    });
    if (same != facets.end()) {
      same->triangles.push_back(triangles[i]);
    } else {
      facets.push_back({normal, height, colours[i], {triangles[i]}});
    }
  }
  TrackedObject object{.name = std::move(name), .faces = {}, .rim = 0};
  for (const Facet& facet : facets) {
    object.faces.push_back({.colour = facet.colour, .corners = outline(facet, vertices)});
  }
  return object;
}

}  // namespace trifinger::tracking
