// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "trifinger/config/file.hpp"

namespace trifinger::camera {
namespace {

Calibration parse(const std::string& text) {
  const config::File file = config::File::parse(text, "cameras.yml");
  Calibration calibration = read_calibration(file.root());
  file.reject_unknown_keys();
  return calibration;
}

Calibration random_calibration(std::mt19937& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  Calibration calibration{.date = "2026-11-23 01:00:00 UTC", .residual = 0.12, .cameras = {}};
  for (const char* name : {"camera60", "camera \"180\"", "c:\\300"}) {
    Camera camera{.name = name, .serial = "40" + std::to_string(random() % 1000)};
    camera.format = {.width = 720, .height = 540, .pixels = PixelFormat::kRgb8};
    camera.lens = {.fx = 587 + number(random),
                   .fy = 590 + number(random),
                   .cx = 290 + number(random),
                   .cy = 270 + number(random),
                   .distortion = {number(random), number(random), number(random), number(random),
                                  number(random)}};
    camera.pose.linear() = Eigen::Quaterniond(Eigen::Vector4d::NullaryExpr(
                                                  [&](Eigen::Index) { return number(random); }))
                               .normalized()
                               .toRotationMatrix();
    camera.pose.translation() << number(random), number(random), number(random);
    calibration.cameras.push_back(camera);
  }
  return calibration;
}

TEST(CameraCalibration, ReadsWhatItHasWritten) {
  std::mt19937 random(3);
  for (int i = 0; i < 20; ++i) {
    const Calibration written = random_calibration(random);
    const Calibration read = parse(written.text());
    EXPECT_EQ(read.date, written.date);
    EXPECT_EQ(read.residual, written.residual);
    ASSERT_EQ(read.cameras.size(), written.cameras.size());
    for (std::size_t k = 0; k < read.cameras.size(); ++k) {
      const Camera& one = read.cameras[k];
      const Camera& other = written.cameras[k];
      EXPECT_EQ(one.name, other.name);
      EXPECT_EQ(one.serial, other.serial);
      EXPECT_EQ(one.format, other.format);
      EXPECT_EQ(one.lens.fx, other.lens.fx);
      EXPECT_EQ(one.lens.cy, other.lens.cy);
      EXPECT_EQ(one.lens.distortion, other.lens.distortion);
      EXPECT_TRUE(one.pose.isApprox(other.pose, 1e-12));
    }
  }
}

TEST(CameraCalibration, NamesWhatMakesNoSense) {
  std::mt19937 random(4);
  const std::string good = random_calibration(random).text();
  const auto problem = [&good](const std::string& from, const std::string& to) -> std::string {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    try {
      static_cast<void>(parse(text));
    } catch (const config::ConfigError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(problem("orientation: [", "orientation: [1.9, 1, 1, 1] #"),
              ::testing::HasSubstr("unit quaternion"));
  EXPECT_THAT(problem("pixels: rgb8", "pixels: rgb9"), ::testing::HasSubstr("rgb9"));
  EXPECT_THAT(problem("\"c:\\\\300\"", "camera60"), ::testing::HasSubstr("two cameras"));
  EXPECT_THAT(problem("width: 720", "width: 0"), ::testing::HasSubstr("16"));
  EXPECT_THAT(problem("serial", "seral"), ::testing::HasSubstr("seral"));
}

}  // namespace
}  // namespace trifinger::camera
