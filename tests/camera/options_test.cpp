// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "camera/cameras_of_tests.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

camera::CameraOptions read(const std::string& text) {
  const config::File file = config::File::parse("cameras: {" + text + "}", "robot.yml");
  camera::CameraOptions options = camera::read_camera_options(file.root().section("cameras"));
  file.reject_unknown_keys();
  return options;
}

camera::Calibration figures() { return {.date = {}, .residual = 0, .cameras = three_cameras()}; }

TEST(CameraOptions, HaveDefaultsForAllButTheSource) {
  const camera::CameraOptions options = read("source: aravis");
  EXPECT_EQ(options.source, camera::SourceKind::kAravis);
  EXPECT_EQ(options.period, 10ms);
  EXPECT_EQ(options.exposure, 1500us);
  EXPECT_THAT(message_of<config::ConfigError>([] { read("rate: 10"); }), HasSubstr("source"));
  EXPECT_THAT(message_of<config::ConfigError>([] { read("source: eyes"); }),
              HasSubstr("simulated"));
  EXPECT_THAT(message_of<config::ConfigError>([] { read("source: folder"); }),
              HasSubstr("cameras.folder"));
  EXPECT_THAT(
      message_of<config::ConfigError>([] { read("source: v4l2, rate: 500, exposure: 0.01"); }),
      HasSubstr("cameras.exposure is longer than the time between two images, 2 ms"));
}

TEST(CameraOptions, SayWhatSimulatedCamerasSee) {
  using camera::RenderingOptions;
  EXPECT_EQ(read("source: simulated").simulated.look, RenderingOptions{});
  const camera::CameraOptions options = read(
      "source: simulated, varies: true, look: {lamp: [0, 0, 2], lamp_power: 0.7, shadows: true, "
      "multisampling: 4, seed: 5}");
  EXPECT_TRUE(options.simulated.varies);
  EXPECT_EQ(
      options.simulated.look,
      (RenderingOptions{
          .multisampling = 4, .shadows = true, .lamp = {0, 0, 2}, .lamp_power = 0.7, .seed = 5}));
  const auto message = [](const std::string& look) {
    return message_of<config::ConfigError>(
        [&] { read("source: simulated, look: {" + look + "}"); });
  };
  EXPECT_THAT(message("dust: 2"), HasSubstr("cameras.look.dust"));
  EXPECT_THAT(message("multisampling: 3"), HasSubstr("multisampling is 3, must be 0, 2, 4 or 8"));
  EXPECT_THAT(message("gain: 2"), HasSubstr("gain"));
  EXPECT_THAT(message("lamp: [0, 0, 0]"), HasSubstr("must be a direction"));
}

TEST(CameraOptions, ChangeSizeAndFormatOfTheCalibration) {
  const camera::CameraOptions options = read("source: simulated, size: 16, pixels: mono8");
  const camera::Calibration calibration = camera::resolve_calibration(options, "robot", figures);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(
        calibration.cameras[i].format,
        (camera::ImageFormat{.width = 16, .height = 16, .pixels = camera::PixelFormat::kMono8}));
    EXPECT_EQ(calibration.cameras[i].lens.fx, figures().cameras[i].lens.fx / 2);
  }
  EXPECT_THAT(message_of<InvalidArgument>([] {
                static_cast<void>(camera::resolve_calibration(read("source: simulated, size: 33"),
                                                              "robot", figures));
              }),
              HasSubstr("cameras.size is 33, must be at most the 32 of the calibration of "
                        "camera60"));
}

TEST(CameraOptions, fault_54_ACameraThatWasNotCalibratedInItsPlaceIsRefused) {
  const auto calibrated = [] {
    camera::Calibration calibration = figures();
    for (std::size_t i = 0; i < 3; ++i) calibration.cameras[i].serial = "4001" + std::to_string(i);
    return calibration;
  };
  // Without a list the calibration decides.
  EXPECT_EQ(
      camera::resolve_calibration(read("source: aravis"), "robot", calibrated).cameras[2].serial,
      "40012");
  EXPECT_EQ(camera::resolve_calibration(read("source: aravis, devices: ['40010', 'any', '40012']"),
                                        "robot", calibrated)
                .cameras[1]
                .serial,
            "40011");
  EXPECT_EQ(
      message_of<InvalidArgument>([&] {
        static_cast<void>(camera::resolve_calibration(
            read("source: aravis, devices: ['40011', '40010', '40012']"), "robot", calibrated));
      }),
      "camera60 was calibrated with serial number 40010, but is to be 40011; correct "
      "cameras.devices, or calibrate the cameras again");
  EXPECT_THAT(message_of<InvalidArgument>([&] {
                static_cast<void>(camera::resolve_calibration(
                    read("source: aravis, devices: ['40011']"), "robot", calibrated));
              }),
              HasSubstr("cameras.devices names 1 devices, but the calibration has 3 cameras"));
}

TEST(CameraOptions, TakeTheCalibrationOfTheRobotOrOfAFile) {
  const Folder folder;
  ::setenv("TRIFINGER_CALIBRATION_DIR", folder.path().c_str(), 1);
  const camera::CameraOptions own = read("source: simulated, calibration: own");
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { static_cast<void>(camera::resolve_calibration(own, "left", figures)); }),
              HasSubstr("the cameras of robot 'left' have not been calibrated: there is no "));
  camera::Calibration measured = figures();
  measured.cameras.resize(1);
  measured.cameras[0].name = "only";
  std::ofstream(folder.path() / "left.cameras.yml") << measured.text();
  EXPECT_EQ(camera::resolve_calibration(own, "left", figures).cameras[0].name, "only");
  const camera::CameraOptions file = read("source: simulated, calibration: '" +
                                          (folder.path() / "left.cameras.yml").string() + "'");
  EXPECT_EQ(camera::resolve_calibration(file, "right", figures).cameras.size(), 1U);
  ::unsetenv("TRIFINGER_CALIBRATION_DIR");
}

TEST(CameraOptions, DevicesMakeNoSmallerImagesThanTheyWereCalibratedWith) {
  const Folder folder;
  const auto path = folder.path() / "cameras.yml";
  std::ofstream(path) << figures().text();
  const auto size = [&](int pixels, const std::string& source) {
    const auto options = read("source: " + source + ", calibration: '" + path.string() +
                              "', size: " + std::to_string(pixels));
    return camera::resolve_calibration(options, "robot", figures).cameras[0].format.width;
  };
  EXPECT_EQ(size(32, "aravis"), 32);
  EXPECT_EQ(size(16, "simulated"), 16);
  EXPECT_THAT(
      message_of<InvalidArgument>([&] { size(16, "v4l2"); }),
      HasSubstr("cameras.size is 16, but camera60 was calibrated with images of 32 pixels"));
}

TEST(CameraOptions, TheOffsetOnTheSensorIsTwoWholeNumbers) {
  EXPECT_FALSE(read("source: aravis").offset);
  EXPECT_EQ(read("source: aravis, offset: [92, 2]").offset, (std::array<int, 2>{92, 2}));
  EXPECT_THAT(message_of<config::ConfigError>([] { read("source: aravis, offset: [92]"); }),
              HasSubstr("cameras.offset"));
  EXPECT_THAT(message_of<config::ConfigError>([] { read("source: aravis, offset: [-1, 2]"); }),
              HasSubstr("cameras.offset"));
}

TEST(CameraOptions, SimulatedCamerasNeedASimulation) {
  EXPECT_EQ(message_of<InvalidArgument>([] {
              static_cast<void>(camera::open_source(read("source: simulated"), three_cameras()));
            }),
            "simulated cameras need their simulation");
}

}  // namespace
}  // namespace trifinger::test
