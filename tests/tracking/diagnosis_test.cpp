// SPDX-License-Identifier: BSD-3-Clause
#include "tracking/diagnosis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "painter.hpp"

namespace trifinger::tracking {
namespace {

using test::Painter;
using test::Pictures;
using test::three_cameras;

TrackedObject cube(double size = 0.065, const BoxColours& colours = competition_colours()) {
  return coloured_box("cube", Eigen::Vector3d::Constant(size), colours, 0.06 * size);
}

// What cameras show of a cube on the table.
Pictures painted(const std::vector<camera::Camera>& cameras, double heading = 0.4) {
  Eigen::Isometry3d pose(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()));
  pose.translation() << 0.05, -0.02, 0.0325;
  Pictures pictures;
  for (const camera::Camera& camera : cameras) {
    const TrackedObject hull = coloured_box("cube", Eigen::Vector3d::Constant(0.065));
    pictures.images.push_back(Painter().paint(camera, cube(), hull, pose));
  }
  return pictures;
}

std::string fault_in(const std::vector<camera::Camera>& cameras, const Pictures& pictures,
                     const TrackedObject& object = cube()) {
  return diagnose(cameras, object, ColourModel::standard(), pictures.spans()).fault;
}

// The image of a camera that delivers pixels in the opposite order along a row.
void mirror(const camera::Camera& camera, std::vector<std::byte>& image) {
  const auto width = static_cast<std::ptrdiff_t>(camera.format.width);
  for (auto row = image.begin(); row != image.end(); row += width) {
    std::reverse(row, row + width);
    std::rotate(row, row + width - 1, row + width);  // the pattern of the mosaic stays
  }
}

TEST(Diagnosis, FindsNothingWrongWithImagesThatFitTogether) {
  const Diagnosis diagnosis =
      diagnose(three_cameras(), cube(), ColourModel::standard(), painted(three_cameras()).spans());
  EXPECT_TRUE(diagnosis.estimate.is_sure());
  EXPECT_EQ(diagnosis.fault, "");
}

TEST(Diagnosis, NamesTheCamerasThatAreExchanged) {
  for (const auto& [a, b, fault] : {std::tuple(0, 1, "camera180 and camera60 are exchanged"),
                                    std::tuple(0, 2, "camera300 and camera60 are exchanged"),
                                    std::tuple(1, 2, "camera180 and camera300 are exchanged")}) {
    Pictures pictures = painted(three_cameras());
    std::swap(pictures.images[static_cast<std::size_t>(a)],
              pictures.images[static_cast<std::size_t>(b)]);
    EXPECT_EQ(fault_in(three_cameras(), pictures), fault);
  }
}

TEST(Diagnosis, NamesCamerasInAnotherOrder) {
  Pictures pictures = painted(three_cameras());
  std::rotate(pictures.images.begin(), pictures.images.begin() + 1, pictures.images.end());
  EXPECT_EQ(fault_in(three_cameras(), pictures),
            "the cameras are in another order: camera300 is camera60, camera60 is camera180, "
            "camera180 is camera300");
}

TEST(Diagnosis, NoticesMirroredImagesInAnyFormat) {
  Pictures pictures = painted(three_cameras());
  mirror(three_cameras()[1], pictures.images[1]);
  EXPECT_EQ(fault_in(three_cameras(), pictures), "the image of camera180 is mirrored");
  mirror(three_cameras()[0], pictures.images[0]);
  mirror(three_cameras()[2], pictures.images[2]);
  EXPECT_EQ(fault_in(three_cameras(), pictures), "all images are mirrored");

  const auto cameras = three_cameras(camera::PixelFormat::kRgb8);
  Pictures turned = painted(cameras);
  for (auto& image : turned.images) {
    std::ranges::reverse(image);
    for (std::size_t i = 0; i < image.size(); i += 3) std::swap(image[i], image[i + 2]);
  }
  EXPECT_EQ(fault_in(cameras, turned), "all images are upside down");
}

TEST(Diagnosis, NoticesRedAndBlueExchanged) {
  const auto cameras = three_cameras(camera::PixelFormat::kRgb8);
  Pictures pictures = painted(cameras);
  for (auto& image : pictures.images) {
    for (std::size_t i = 0; i < image.size(); i += 3) std::swap(image[i], image[i + 2]);
  }
  EXPECT_EQ(fault_in(cameras, pictures), "all images are with red and blue exchanged");
}

TEST(Diagnosis, TellsTheSizeOfTheObject) {
  EXPECT_EQ(fault_in(three_cameras(), painted(three_cameras()), cube(0.05)),
            "cube is about 130 % as large as it is said to be");
  EXPECT_EQ(fault_in(three_cameras(), painted(three_cameras()), cube(0.08)),
            "cube is about 81 % as large as it is said to be");
}

TEST(Diagnosis, TellsTheColoursOfTheObject) {
  BoxColours colours = competition_colours();
  std::swap(colours[0], colours[2]);
  EXPECT_EQ(fault_in(three_cameras(), painted(three_cameras()), cube(0.065, colours)),
            "the blue and red faces of cube are exchanged");
}

TEST(Diagnosis, NamesAnImageThatDoesNotFit) {
  Pictures pictures = painted(three_cameras());
  pictures.images[2] = painted(three_cameras(), 1.0).images[2];
  EXPECT_EQ(fault_in(three_cameras(), pictures),
            "the image of camera300 does not fit to the others");
}

TEST(Diagnosis, DoesNotExplainImagesOfNothing) {
  Pictures pictures = painted(three_cameras());
  for (auto& image : pictures.images) std::ranges::fill(image, std::byte{110});
  const Diagnosis diagnosis =
      diagnose(three_cameras(), cube(), ColourModel::standard(), pictures.spans());
  EXPECT_FALSE(diagnosis.estimate.is_sure());
  EXPECT_EQ(diagnosis.fault, "");
}

}  // namespace
}  // namespace trifinger::tracking
