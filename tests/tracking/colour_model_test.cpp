// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/tracking/colour_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "painter.hpp"
#include "tracking/colour_samples.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::tracking {
namespace {

ColourModel parsed(const std::string& text) {
  return read_colour_model(config::File::parse(text, "colours.yml").root());
}

TEST(ColourModel, KnowsTheColoursOfTheCompetition) {
  for (const std::string& colour : competition_colours())
    EXPECT_NE(ColourModel::standard().find(colour), nullptr) << colour;
  EXPECT_EQ(ColourModel::standard().find("mauve"), nullptr);
}

TEST(ColourModel, IsTheSameAfterWritingAndReading) {
  const ColourModel& model = ColourModel::standard();
  EXPECT_EQ(parsed(model.text()).text(), model.text());
}

TEST(ColourModel, SaysWhatIsWrongInAFile) {
  const auto error_of = [](const std::string& text) -> std::string {
    try {
      (void)parsed(text);
    } catch (const config::ConfigError& error) {
      return error.what();
    }
    return "";
  };
  const std::string bell = "    bells:\n      - {weight: 1, mean: [0, 0, 0], covariance: ";
  EXPECT_THAT(error_of("colours:\n  - name: red\n" + bell + "[1, 0, 0, 1, 0, 1]}\n"),
              testing::HasSubstr("no colour 'background'"));
  EXPECT_THAT(error_of("colours:\n  - name: red\n" + bell + "[1, 2, 0, 1, 0, 1]}\n"),
              testing::HasSubstr("positive definite"));
}

TEST(ColourFeatures, DoNotChangeWithTheLightExceptForTheLast) {
  const Eigen::Vector3d bright = colour_features(200, 100, 50);
  const Eigen::Vector3d dim = colour_features(100, 50, 25);
  EXPECT_NEAR(bright.x(), dim.x(), 0.1);
  EXPECT_NEAR(bright.y(), dim.y(), 0.1);
  EXPECT_GT(bright.z(), dim.z() + 0.5);
}

TEST(BalancedBlocks, MakeMostOfAnImageGreyWhateverItsWhiteBalance) {
  const camera::Camera camera = test::three_cameras().front();
  test::Painter painter;
  painter.background = {140, 100, 70};
  const TrackedObject cube = coloured_box("cube", {0.065, 0.065, 0.065});
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation().z() = 0.0325;
  const auto blocks = balanced_blocks(camera.format, painter.paint(camera, cube, cube, pose));
  EXPECT_NEAR(blocks.front().x() / blocks.front().y(), 1, 0.03);
  EXPECT_NEAR(blocks.front().z() / blocks.front().y(), 1, 0.03);
}

TEST(FacesInBlocks, AreThoseThatAreSeen) {
  const camera::Camera camera = test::three_cameras().front();
  const TrackedObject cube = coloured_box("cube", {0.065, 0.065, 0.065});
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation().z() = 0.0325;
  test::Painter painter;
  // Only the blocks that show one face as a whole have its number: they all have its colour.
  const auto blocks = balanced_blocks(camera.format, painter.paint(camera, cube, cube, pose));
  const std::vector<int> faces = faces_in_blocks(camera, cube, pose);
  ASSERT_EQ(faces.size(), blocks.size());
  std::vector<int> counts(6, 0);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i] == static_cast<int>(BlockContent::kNothing)) {
      EXPECT_NEAR(blocks[i].x(), blocks[i].y(), 5);
    }
    if (faces[i] < 0) continue;
    ++counts[static_cast<std::size_t>(faces[i])];
    const auto& colour = painter.colours.at(cube.faces[static_cast<std::size_t>(faces[i])].colour);
    EXPECT_LT((blocks[i].cast<double>() - colour).norm(), 12);
  }
  EXPECT_GT(counts[2], 300);  // the top
  EXPECT_EQ(counts[3], 0);    // the bottom
}

}  // namespace
}  // namespace trifinger::tracking
