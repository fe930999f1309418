// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/camera_renderer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "rendering/scenes.hpp"
#include "sim/robot_cameras.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::rendering {
namespace {

using camera::Camera;
using camera::PixelFormat;
using ::testing::HasSubstr;

constexpr double kBallRadius = 0.0125;

// One finger, so that little hides what is on the table.
RobotDescription scene_with_ball() {
  RobotDescription description;
  description.variant = Variant::kPro;  // with a dark table
  description.arrangement = Arrangement::kSingleFinger;
  description.objects = {
      {.name = "ball", .shape = ObjectShape::kBall, .size = {2 * kBallRadius, 0, 0}, .mass = 0.01}};
  return description;
}

// Where the middle of a ball's outline is seen: the mean over the disc that hides the rest of it.
Eigen::Vector2d middle_of_ball(const Camera& camera, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d away = centre - camera.pose.translation();
  const double ratio = kBallRadius / away.norm();
  const Eigen::Vector3d normal = away.normalized();
  const Eigen::Vector3d u = normal.unitOrthogonal();
  const Eigen::Vector3d v = normal.cross(u);
  const Eigen::Vector3d middle = camera.pose.translation() + (1 - ratio * ratio) * away;
  const double radius = kBallRadius * std::sqrt(1 - ratio * ratio);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  constexpr int kPoints = 2000;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0));  // a sunflower
    const double at = radius * std::sqrt((i + 0.5) / kPoints);
    sum += *camera.project(middle + at * (std::cos(angle) * u + std::sin(angle) * v));
  }
  return sum / kPoints;
}

// The middle of what differs between two images, and its area [pixel]. Nothing if it touches the
// border.
struct Spot {
  Eigen::Vector2d middle;
  double area;
};
std::optional<Spot> difference(const Camera& camera, const std::vector<std::byte>& one,
                               const std::vector<std::byte>& other) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0;
  double most = 0;
  const int width = camera.format.width;
  const int height = camera.format.height;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(column);
      // The colours of the ball shall not count, only its outline.
      constexpr double kMost = 8;
      const double change = std::min<double>(
          std::abs(std::to_integer<int>(one[i]) - std::to_integer<int>(other[i])), kMost);
      if (change == 0) continue;
      if (row == 0 || column == 0 || row == height - 1 || column == width - 1) return std::nullopt;
      sum += change * Eigen::Vector2d(column, row);
      weight += change;
      most = std::max(most, change);
    }
  }
  if (weight == 0) return std::nullopt;
  return Spot{sum / weight, weight / most};
}

double area_of_ball(const Camera& camera, const Eigen::Vector3d& centre) {
  const double distance = (centre - camera.pose.translation()).norm();
  return std::numbers::pi * std::pow(camera.lens.fx * kBallRadius / distance, 2);
}

double quantile(std::vector<double> numbers, double share) {
  std::ranges::sort(numbers);
  return numbers[static_cast<std::size_t>(share * static_cast<double>(numbers.size() - 1))];
}

// Compares where balls are seen with where the cameras of the renderer should see them.
void expect_balls_in_place(CameraRenderer& renderer, const RobotDescription& description,
                           const std::vector<Camera>& cameras) {
  Random random{.seed = 4};
  const Images empty = render(renderer, configuration(description, {0, 0, -2}));
  std::vector<std::vector<double>> errors(2 * cameras.size());  // columns and rows of each camera
  for (int trial = 0; trial < 25; ++trial) {
    const Eigen::Vector3d centre(random.uniform(-0.25, 0.25), random.uniform(-0.25, 0.25),
                                 random.uniform(0.02, 0.15));
    const Images seen = render(renderer, configuration(description, centre));
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const auto spot = difference(cameras[i], empty.bytes[i], seen.bytes[i]);
      // Behind the finger, a part of the ball is missing.
      if (!spot || spot->area < 0.9 * area_of_ball(cameras[i], centre)) continue;
      const Eigen::Vector2d error = spot->middle - middle_of_ball(cameras[i], centre);
      errors[2 * i].push_back(error.x());
      errors[2 * i + 1].push_back(error.y());
    }
  }
  for (std::vector<double>& list : errors) {
    ASSERT_GE(list.size(), 8U);
    EXPECT_NEAR(quantile(list, 0.5), 0, 0.1);
    // A drawn ball has corners, and a finger may hide a small part of it.
    for (double& error : list) error = std::abs(error);
    EXPECT_LT(quantile(list, 0.7), 0.2);
  }
}

RobotDescription bare_scene() {
  RobotDescription description = scene_with_ball();
  description.boundary = false;
  return description;
}

RenderingOptions precise() {
  RenderingOptions options = plain();
  options.detail = 2;  // Steps at edges would move the middle of a ball by a tenth of a pixel.
  options.roundness = 40;
  return options;
}

TEST(CameraRenderer, fault_64_RefusesToDrawInAForkedChildOfAProcessThatHasDrawn) {
  const RobotDescription description = scene_with_ball();
  const std::vector<Camera> cameras{calibration_of_figures({}).cameras[0].reduced(18)};
  std::optional<CameraRenderer> renderer(std::in_place,
                                         SimulationOptions{.description = description}, cameras);
  test::ChildProcess child([&] {
    const auto refuses = [](const auto& call) {
      try {
        call();
        return false;
      } catch (const InheritedHandle&) {
        return true;
      }
    };
    if (!refuses([&] { renderer->set_options({.roundness = 12}); })) return 2;
    renderer.reset();
    return refuses([&] { const CameraRenderer own({.description = description}, cameras); }) ? 0
                                                                                             : 3;
  });
  EXPECT_EQ(child.wait(), 0);
  renderer->set_options({.roundness = 12});
}

TEST(CameraRenderer, ShowsPointsWhereTheCameraProjectsThem) {
  const RobotDescription description = bare_scene();
  CameraRenderer renderer({.description = description},
                          cameras(description, 1, PixelFormat::kMono8), precise());
  expect_balls_in_place(renderer, description, renderer.cameras());
}

TEST(CameraRenderer, ShowsPointsWhereCamerasOfHalfTheSizeProjectThem) {
  const RobotDescription description = bare_scene();
  CameraRenderer renderer({.description = description},
                          cameras(description, 2, PixelFormat::kMono8), precise());
  expect_balls_in_place(renderer, description, renderer.cameras());
}

TEST(CameraRenderer, ShowsPointsWhereAStrongLensAndAWideImageProjectThem) {
  const RobotDescription description = bare_scene();
  std::vector<Camera> wide = cameras(description, 1, PixelFormat::kMono8);
  for (Camera& camera : wide) {
    camera.format.width = 720;
    camera.lens.cx += 90;
    camera.lens.distortion = {-0.4, 0.2, 0.01, -0.008, -0.05};
    camera.lens.fy *= 1.1;
  }
  CameraRenderer renderer({.description = description}, wide, precise());
  expect_balls_in_place(renderer, description, wide);
}

TEST(CameraRenderer, ShowsPointsWhereTheTrueCamerasAreIfTheCalibrationHasErrors) {
  const RobotDescription description = bare_scene();
  RenderingOptions options = precise();
  options.calibration_error = 5;
  CameraRenderer renderer({.description = description},
                          cameras(description, 1, PixelFormat::kMono8), options);
  EXPECT_NE(renderer.true_cameras()[0].lens.cx, renderer.cameras()[0].lens.cx);
  expect_balls_in_place(renderer, description, renderer.true_cameras());
}

TEST(CameraRenderer, EachValueOfAMosaicIsThatOfOneColourThere) {
  const RobotDescription description;
  const auto where = configuration(description, {0.02, 0.03, 0.05});
  CameraRenderer mosaic({.description = description}, cameras(description, 2), plain());
  CameraRenderer colours({.description = description}, cameras(description, 2, PixelFormat::kRgb8),
                         plain());
  CameraRenderer brightness({.description = description},
                            cameras(description, 2, PixelFormat::kMono8), plain());
  const Images raw = render(mosaic, where);
  const Images rgb = render(colours, where);
  const Images grey = render(brightness, where);
  for (std::size_t camera = 0; camera < raw.bytes.size(); ++camera) {
    for (std::size_t row = 0; row < 270; ++row) {
      for (std::size_t column = 0; column < 270; ++column) {
        // The first row begins R G, the second one G B.
        const std::size_t channel = row % 2 + column % 2;
        const std::size_t i = row * 270 + column;
        const auto value = [&](std::size_t of) {
          return 1.0 * std::to_integer<int>(rgb.bytes[camera][3 * i + of]);
        };
        ASSERT_EQ(std::to_integer<int>(raw.bytes[camera][i]), value(channel));
        ASSERT_NEAR(1.0 * std::to_integer<int>(grey.bytes[camera][i]),
                    0.299 * value(0) + 0.587 * value(1) + 0.114 * value(2), 2);
      }
    }
  }
}

// The mean of an image's red, green and blue around a point.
Eigen::Vector3d colour_at(const Camera& camera, const std::vector<std::byte>& image,
                          const Eigen::Vector3d& point) {
  const Eigen::Vector2d at = *camera.project(point);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const auto row = static_cast<int>(std::lround(at.y())) + dy;
      const auto column = static_cast<int>(std::lround(at.x())) + dx;
      const int pixel = row * camera.format.width + column;
      const std::size_t i = 3 * static_cast<std::size_t>(pixel);
      for (std::size_t c = 0; c < 3; ++c) {
        sum[static_cast<Eigen::Index>(c)] += std::to_integer<int>(image[i + c]) / 9.0;
      }
    }
  }
  return sum;
}

TEST(CameraRenderer, TheFacesOfTheCubeHaveTheColoursOfTheRealOne) {
  RobotDescription description;
  description.arrangement = Arrangement::kSingleFinger;
  const std::vector<Camera> all = cameras(description, 1, PixelFormat::kRgb8);
  CameraRenderer renderer({.description = description}, all, plain());
  const Eigen::Vector3d centre(0, 0, 0.06);
  struct Face {
    Eigen::Vector3d normal;
    Eigen::Vector3d colour;
  };
  const std::vector<Face> faces{{{1, 0, 0}, {195, 48, 0}},    {{0, 1, 0}, {153, 208, 96}},
                                {{0, 0, 1}, {4, 35, 96}},     {{0, 0, -1}, {116, 200, 191}},
                                {{-1, 0, 0}, {164, 91, 164}}, {{0, -1, 0}, {255, 235, 108}}};
  int seen = 0;
  // Turned so that each face looks up and to a camera once.
  for (const Face& face : faces) {
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond::FromTwoVectors(face.normal, Eigen::Vector3d::UnitZ());
    const Images images = render(renderer, configuration(description, centre, turn));
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Eigen::Vector3d top = centre + turn * (0.0325 * face.normal);
      EXPECT_LT((colour_at(all[i], images.bytes[i], top) - face.colour).norm(), 3)
          << all[i].name << ": " << colour_at(all[i], images.bytes[i], top).transpose();
      ++seen;
    }
  }
  EXPECT_EQ(seen, 18);
}

TEST(CameraRenderer, CamerasOfAFlippedPlatformTurnWithIt) {
  RobotDescription flipped = scene_with_ball();
  flipped.flipped = true;
  const std::vector<Camera> all = cameras(flipped, 1, PixelFormat::kMono8);
  const std::vector<Camera> upright = cameras(scene_with_ball(), 1, PixelFormat::kMono8);
  EXPECT_NEAR(all[0].pose.translation().z(),
              flip_height(flipped) - upright[0].pose.translation().z(), 1e-12);
  EXPECT_NEAR(all[0].pose.translation().x(), -upright[0].pose.translation().x(), 1e-12);
  // They look up to what they looked down to.
  EXPECT_GT((all[0].pose.linear() * Eigen::Vector3d::UnitZ()).z(), 0.5);
  CameraRenderer renderer({.description = flipped}, all, precise());
  const Images empty = render(renderer, configuration(flipped, {0, 0, -2}));
  const Eigen::Vector3d centre(0.01, 0.02, flip_height(flipped) - 0.1);
  const Images seen = render(renderer, configuration(flipped, centre));
  int found = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto spot = difference(all[i], empty.bytes[i], seen.bytes[i]);
    if (!spot || spot->area < 0.75 * area_of_ball(all[i], centre)) continue;
    ++found;
    EXPECT_LT((spot->middle - middle_of_ball(all[i], centre)).norm(), 1);
  }
  EXPECT_GE(found, 1);
}

TEST(CameraRenderer, EqualArgumentsGiveEqualImages) {
  const RobotDescription description;
  const auto where = configuration(description, {0, 0, 0.0325});
  RenderingVariation variation;
  Random random{.seed = 9};
  const RenderingOptions options = variation.draw({}, random);
  CameraRenderer one({.description = description}, cameras(description, 2), options);
  CameraRenderer other({.description = description}, cameras(description, 2));
  (void)render(other, where, 5);
  other.set_options(options);
  EXPECT_EQ(render(one, where, 1), render(other, where, 1));
  EXPECT_NE(render(one, where, 2), render(one, where, 3)) << "the noise must differ";
  EXPECT_EQ(render(one, where, 2), render(other, where, 2));
}

TEST(CameraRenderer, NoiseHasTheVarianceOfItsOptions) {
  const RobotDescription description;
  const auto where = configuration(description, {0, 0, 0.0325});
  const auto all = cameras(description, 2);
  CameraRenderer quiet({.description = description}, all, plain());
  RenderingOptions options = plain();
  options.read_noise = 2;
  options.shot_noise = 0.05;
  CameraRenderer noisy({.description = description}, all, options);
  const Images mean = render(quiet, where);
  std::array<double, 2> squares{};  // of dark and bright values, by what is expected
  std::array<int, 2> counts{};
  for (std::uint64_t number = 0; number < 4; ++number) {
    const Images images = render(noisy, where, number);
    for (std::size_t i = 0; i < images.bytes[0].size(); ++i) {
      const int level = std::to_integer<int>(mean.bytes[0][i]);
      if (level < 20 || level > 235) continue;  // cut off
      const double error = std::to_integer<int>(images.bytes[0][i]) - level;
      const std::size_t kind = level < 128 ? 0 : 1;
      // Rounding adds a twelfth, twice.
      squares.at(kind) += error * error / (4 + 0.05 * level + 1.0 / 6);
      ++counts.at(kind);
    }
  }
  for (std::size_t kind = 0; kind < 2; ++kind) {
    ASSERT_GT(counts.at(kind), 10000);
    EXPECT_NEAR(squares.at(kind) / counts.at(kind), 1, 0.03);
  }
}

TEST(CameraRenderer, GainIsAFactorUntilTheLevelsEnd) {
  const RobotDescription description;
  const auto where = configuration(description, {0, 0, 0.0325});
  CameraRenderer renderer({.description = description}, cameras(description, 2), plain());
  const Images before = render(renderer, where);
  RenderingOptions options = plain();
  options.gain = 1.5;
  renderer.set_options(options);
  const Images after = render(renderer, where);
  for (std::size_t i = 0; i < before.bytes[0].size(); ++i) {
    const double expected = std::min(255.0, 1.5 * std::to_integer<int>(before.bytes[0][i]));
    ASSERT_NEAR(std::to_integer<int>(after.bytes[0][i]), expected, 1.3);
  }
}

TEST(CameraRenderer, WhatMovesIsBlurredAlongItsPath) {
  const RobotDescription description = bare_scene();
  RenderingOptions options = precise();
  options.exposure = std::chrono::milliseconds(10);
  options.blur_steps = 16;
  const auto all = cameras(description, 1, PixelFormat::kMono8);
  CameraRenderer renderer({.description = description}, all, options);
  const Eigen::Vector3d centre(0, 0.05, 0.1);
  std::vector<double> still = configuration(description, centre);
  std::vector<double> moving = still;
  still.resize(still.size() + 3 + 6);
  moving.resize(still.size());
  moving[still.size() - 6] = 2;  // 20 mm during the exposure
  const Images empty = render(renderer, configuration(description, {0, 0, -2}));
  const Images sharp = render(renderer, still);
  const Images blurred = render(renderer, moving);
  EXPECT_EQ(sharp, render(renderer, configuration(description, centre)));
  int found = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto spot = difference(all[i], empty.bytes[i], sharp.bytes[i]);
    const auto path = difference(all[i], empty.bytes[i], blurred.bytes[i]);
    if (!spot || !path || spot->area < 0.75 * area_of_ball(all[i], centre)) continue;
    ++found;
    // The configuration is that in the middle of the exposure.
    EXPECT_LT((spot->middle - path->middle).norm(), 1);
    // Pixels that differ: more by the length of the path.
    const auto count = [&](const Images& images) {
      int pixels = 0;
      for (std::size_t k = 0; k < images.bytes[i].size(); ++k) {
        pixels += images.bytes[i][k] != empty.bytes[i][k] ? 1 : 0;
      }
      return pixels;
    };
    const double length = (*all[i].project(centre + Eigen::Vector3d(0.01, 0, 0)) -
                           *all[i].project(centre - Eigen::Vector3d(0.01, 0, 0)))
                              .norm();
    const double width =
        2 * all[i].lens.fx * kBallRadius / (centre - all[i].pose.translation()).norm();
    EXPECT_NEAR(count(blurred) - count(sharp), length * width, 0.2 * length * width);
  }
  EXPECT_GE(found, 2);
}

TEST(CameraRenderer, EveryVariationChangesTheImage) {
  const RobotDescription description;
  const auto where = configuration(description, {0, 0, 0.0325});
  CameraRenderer renderer({.description = description}, cameras(description, 2), plain());
  const Images reference = render(renderer, where);
  const auto expect_change = [&](const char* name, RenderingOptions options) {
    renderer.set_options(options);
    EXPECT_NE(render(renderer, where), reference) << name;
    renderer.set_options(plain());
    EXPECT_EQ(render(renderer, where), reference) << "after " << name;
  };
  const auto with = [](auto member, auto value) {
    RenderingOptions options = plain();
    options.*member = value;
    return options;
  };
  expect_change("detail", with(&RenderingOptions::detail, 2.0));
  expect_change("multisampling", with(&RenderingOptions::multisampling, 4));
  expect_change("roundness", with(&RenderingOptions::roundness, 8));
  expect_change("lamp_power", with(&RenderingOptions::lamp_power, 0.4));
  expect_change("ambient_power", with(&RenderingOptions::ambient_power, 0.9));
  expect_change("light_colour", with(&RenderingOptions::light_colour, Triple{1, 0.9, 0.8}));
  expect_change("colour_spread", with(&RenderingOptions::colour_spread, 0.1));
  expect_change("dust", with(&RenderingOptions::dust, 0.8));
  expect_change("gain", with(&RenderingOptions::gain, 0.9));
  expect_change("vignetting", with(&RenderingOptions::vignetting, 0.3));
  expect_change("read_noise", with(&RenderingOptions::read_noise, 1.0));
  expect_change("shot_noise", with(&RenderingOptions::shot_noise, 0.1));
  expect_change("calibration_error", with(&RenderingOptions::calibration_error, 1.0));
  RenderingOptions lit = plain();
  lit.lamp_power = 0.5;
  RenderingOptions shaded = lit;
  shaded.shadows = true;
  renderer.set_options(lit);
  const Images without = render(renderer, where);
  renderer.set_options(shaded);
  EXPECT_NE(render(renderer, where), without) << "shadows";
}

TEST(CameraRenderer, ThreadsMayPassItOnAndHaveOthersBesideIt) {
  const RobotDescription description;
  const auto where = configuration(description, {0, 0, 0.0325});
  CameraRenderer renderer({.description = description}, cameras(description, 2), plain());
  const Images expected = render(renderer, where);
  Images passed_on;
  Images beside;
  std::thread first([&] { passed_on = render(renderer, where); });
  std::thread second([&] {
    CameraRenderer own({.description = description}, cameras(description, 2), plain());
    beside = render(own, where);
  });
  first.join();
  second.join();
  EXPECT_EQ(passed_on, expected);
  EXPECT_EQ(beside, expected);
  EXPECT_EQ(render(renderer, where), expected);
}

TEST(CameraRenderer, RefusesWhatMakesNoSense) {
  const RobotDescription description;
  CameraRenderer renderer({.description = description}, cameras(description, 2));
  const auto message = [&](const auto& function) {
    return test::message_of<InvalidArgument>(function);
  };
  EXPECT_THAT(message([&] { (void)render(renderer, std::vector<double>(3)); }),
              HasSubstr("3 numbers, must have 16, or 31 with velocities"));
  std::vector<double> odd = configuration(description, {0, 0, 0});
  odd.back() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message([&] { (void)render(renderer, odd); }), HasSubstr("not finite"));
  EXPECT_THAT(message([&] { renderer.render(configuration(description, {0, 0, 0}), 0, {}); }),
              HasSubstr("0 images were given for 3 cameras"));
  EXPECT_THAT(message([&] { CameraRenderer({.description = description}, {}); }),
              HasSubstr("needs a camera"));
  EXPECT_THAT(message([&] { renderer.set_options({.multisampling = 3}); }),
              HasSubstr("multisampling is 3, must be 0, 2, 4 or 8"));
  EXPECT_THAT(message([&] { renderer.set_options({.dust = 1.5}); }),
              HasSubstr("dust is 1.5, must be from 0 to 1"));
  EXPECT_THAT(message([&] { renderer.set_options({.lamp = {0, 0, 0}}); }),
              HasSubstr("must be a direction"));
}

TEST(Misaligned, IsOffByTheGivenNumberOfPixels) {
  Random random{.seed = 3};
  for (const Camera& camera : cameras(RobotDescription{})) {
    for (const double error : {0.0, 0.1, 0.5, 3.0}) {
      const Camera other = misaligned(camera, error, random);
      double sum = 0;
      int count = 0;
      for (double x = -0.15; x < 0.16; x += 0.05) {
        for (double y = -0.15; y < 0.16; y += 0.05) {
          for (double z = 0; z < 0.11; z += 0.05) {
            const Eigen::Vector3d point(x, y, z);
            sum += (*camera.project(point) - *other.project(point)).squaredNorm();
            ++count;
          }
        }
      }
      // Other points than its own.
      EXPECT_NEAR(std::sqrt(sum / count), error, 0.35 * error);
      EXPECT_TRUE(other.pose.linear().isUnitary(1e-9));
    }
  }
}

}  // namespace
}  // namespace trifinger::rendering
