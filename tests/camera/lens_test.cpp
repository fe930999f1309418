// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "trifinger/base/error.hpp"
#include "trifinger/camera/camera.hpp"

namespace trifinger::camera {
namespace {

// The lens of a real camera of 540 x 540 pixels.
const Lens kLens{.fx = 587.298,
                 .fy = 591.540,
                 .cx = 291.286,
                 .cy = 277.456,
                 .distortion = {-0.23805, 0.10826, -0.00246, 0.00005, -0.02723}};

TEST(Lens, SeesThePixelThroughWhichARayWasSent) {
  for (double column = -0.5; column <= 539.5; column += 13.5) {
    for (double row = -0.5; row <= 539.5; row += 13.5) {
      const Eigen::Vector2d pixel(column, row);
      EXPECT_LT((kLens.project(kLens.unproject(pixel)) - pixel).norm(), 1e-6) << pixel.transpose();
    }
  }
}

TEST(Lens, HasTheDerivativeOfItsProjection) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> anywhere(-0.45, 0.45);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d ray(anywhere(random), anywhere(random));
    Eigen::Matrix2d numerical;
    for (int axis = 0; axis < 2; ++axis) {
      const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
      numerical.col(axis) = (kLens.project(Eigen::Vector2d(ray + step)) -
                             kLens.project(Eigen::Vector2d(ray - step))) /
                            (2 * kStep);
    }
    EXPECT_LT((kLens.derivative(ray) - numerical).norm(), 1e-5);
  }
}

// The equations of OpenCV's documentation, computed by hand.
TEST(Lens, FollowsTheEquationsOfOpenCv) {
  const Lens plain{
      .fx = 600, .fy = 590, .cx = 280, .cy = 270, .distortion = {-0.2, 0.1, 0.001, -0.002, 0.05}};
  // r2 = 0.13: radial = 1 - 0.026 + 0.00169 + 0.00010985 = 0.97579985.
  // x = 0.3 * 0.97579985 + 2 * 0.001 * -0.06 - 0.002 * (0.13 + 0.18) = 0.291999955
  // y = -0.2 * 0.97579985 + 0.001 * (0.13 + 0.08) + 2 * -0.002 * -0.06 = -0.19470997
  const Eigen::Vector2d pixel = plain.project(Eigen::Vector3d(0.6, -0.4, 2.0));
  EXPECT_NEAR(pixel.x(), 600 * 0.291999955 + 280, 1e-9);
  EXPECT_NEAR(pixel.y(), 590 * -0.19470997 + 270, 1e-9);
}

// Halving an image averages the pixels 2 i and 2 i + 1, whose middle is 2 i + 0.5.
TEST(Lens, SeesTheSamePointInImagesOfHalfTheSize) {
  const Lens half = kLens.scaled(0.5);
  const Eigen::Vector2d ray(0.2, -0.3);
  const Eigen::Vector2d whole = kLens.project(ray);
  EXPECT_LT((half.project(ray) - (whole - Eigen::Vector2d(0.5, 0.5)) / 2).norm(), 1e-12);
}

TEST(Camera, SeesNothingBehindItself) {
  Camera camera{.name = "above", .lens = kLens};
  camera.pose.translation() << 0, 0, -1;
  EXPECT_TRUE(camera.project({0, 0, 0}).has_value());
  EXPECT_FALSE(camera.project({0, 0, -1}).has_value());
  EXPECT_FALSE(camera.project({0, 0, -2}).has_value());
}

TEST(Camera, CannotBeReducedToPartsOfPixels) {
  EXPECT_EQ(Camera{}.reduced(2).format.width, 270);
  EXPECT_THROW(static_cast<void>(Camera{}.reduced(7)), InvalidArgument);
  EXPECT_THROW(static_cast<void>(Camera{}.reduced(0)), InvalidArgument);
}

TEST(Camera, ShowsTheMiddleInImagesOfAnySize) {
  Camera whole{.name = "above", .format = {.width = 720, .height = 540}, .lens = kLens};
  const Eigen::Vector2d ray(0.05, -0.03);
  for (const int width : {720, 540, 360, 84, 64, 7, 1}) {
    const Camera part = whole.resized(width);
    EXPECT_EQ(part.format.width, width);
    EXPECT_EQ(part.format.height, std::max(1, width * 3 / 4));
    // What is in the middle stays there, and a pixel is a square of whole pixels.
    const double factor = whole.lens.fx / part.lens.fx;
    EXPECT_NEAR(factor, std::floor(720.0 / width), 1e-9);
    const auto from_middle = [&](const Camera& camera) {
      const Eigen::Vector2d last(camera.format.width - 1, camera.format.height - 1);
      return Eigen::Vector2d(camera.lens.project(ray) - 0.5 * last);
    };
    EXPECT_LT((factor * from_middle(part) - from_middle(whole)).cwiseAbs().maxCoeff(), 0.5001);
  }
  EXPECT_THROW(static_cast<void>(whole.resized(721)), InvalidArgument);
  EXPECT_THROW(static_cast<void>(whole.resized(0)), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::camera
