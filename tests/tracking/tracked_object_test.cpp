// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/tracking/tracked_object.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "trifinger/base/error.hpp"

namespace trifinger::tracking {
namespace {

TEST(ColouredBox, ShowsItsFacesToTheOutside) {
  for (const double rim : {0.0, 0.003}) {
    const TrackedObject box = coloured_box("box", {0.02, 0.08, 0.04}, competition_colours(), rim);
    ASSERT_EQ(box.faces.size(), 6U);
    for (const ColouredFace& face : box.faces) {
      ASSERT_EQ(face.corners.size(), 4U);
      const Eigen::Vector3d normal =
          (face.corners[1] - face.corners[0]).cross(face.corners[2] - face.corners[1]);
      EXPECT_GT(normal.dot(face.corners[0]), 0);
    }
  }
}

TEST(ColouredBox, RefusesARimThatLeavesNothing) {
  EXPECT_THROW((void)coloured_box("box", {0.02, 0.08, 0.02}, competition_colours(), 0.01),
               InvalidArgument);
  EXPECT_THROW((void)coloured_box("box", {0.02, 0, 0.02}), InvalidArgument);
}

TEST(TrackedObject, IsWhatTheSimulationDraws) {
  const TrackedObject object = tracked_object(cube());
  EXPECT_EQ(object.name, "cube");
  EXPECT_NEAR(object.faces[0].corners[0].y(), -(0.0325 - box_rim(cube())), 1e-12);
  EXPECT_THROW((void)tracked_object(ball()), InvalidArgument);
}

TEST(LookAlikes, AreCounted) {
  const auto box = [](const Eigen::Vector3d& size, const BoxColours& colours) {
    return look_alikes(coloured_box("box", size, colours));
  };
  const Eigen::Vector3d cube = Eigen::Vector3d::Constant(0.065);
  const Eigen::Vector3d cuboid(0.02, 0.08, 0.02);
  const Eigen::Vector3d brick(0.02, 0.08, 0.04);
  const BoxColours red{"red", "red", "red", "red", "red", "red"};
  EXPECT_EQ(box(cube, competition_colours()), 0);
  EXPECT_EQ(box(cube, red), 23);
  EXPECT_EQ(box(cuboid, red), 7);
  EXPECT_EQ(box(brick, red), 3);
  // The top, the floor, and four sides alike.
  EXPECT_EQ(box(cube, {"red", "red", "blue", "cyan", "red", "red"}), 3);
  EXPECT_EQ(box(brick, {"red", "red", "blue", "cyan", "red", "red"}), 1);
}

// A box of twelve triangles.
struct BoxMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::string> colours;

  BoxMesh() {
    const TrackedObject box = coloured_box("box", {0.02, 0.08, 0.04});
    for (const ColouredFace& face : box.faces) {
      std::array<int, 4> corners{};
      for (std::size_t i = 0; i < 4; ++i) {
        corners[i] = static_cast<int>(vertices.size());
        for (std::size_t k = 0; k < vertices.size(); ++k)
          if ((vertices[k] - face.corners[i]).norm() < 1e-9) corners[i] = static_cast<int>(k);
        if (static_cast<std::size_t>(corners[i]) == vertices.size())
          vertices.push_back(face.corners[i]);
      }
      triangles.push_back({corners[0], corners[1], corners[2]});
      triangles.push_back({corners[0], corners[2], corners[3]});
      colours.insert(colours.end(), 2, face.colour);
    }
  }
};

TEST(ColouredMesh, JoinsTrianglesOfOnePlaneAndColour) {
  const BoxMesh mesh;
  const TrackedObject box = coloured_box("box", {0.02, 0.08, 0.04});
  const TrackedObject object = coloured_mesh("box", mesh.vertices, mesh.triangles, mesh.colours);
  ASSERT_EQ(object.faces.size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(object.faces[i].colour, box.faces[i].colour);
    EXPECT_THAT(object.faces[i].corners, testing::UnorderedElementsAreArray(box.faces[i].corners));
  }
}

TEST(ColouredMesh, RefusesWhatIsNotConvex) {
  BoxMesh mesh;
  mesh.vertices.emplace_back(0.5, 0, 0);
  EXPECT_THROW((void)coloured_mesh("box", mesh.vertices, mesh.triangles, mesh.colours),
               InvalidArgument);
  mesh.vertices.pop_back();
  mesh.colours.pop_back();
  EXPECT_THROW((void)coloured_mesh("box", mesh.vertices, mesh.triangles, mesh.colours),
               InvalidArgument);
}

}  // namespace
}  // namespace trifinger::tracking
