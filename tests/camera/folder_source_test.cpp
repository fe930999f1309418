// SPDX-License-Identifier: BSD-3-Clause
#include "camera/folder_source.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "camera/cameras_of_tests.hpp"
#include "camera/grabbed.hpp"
#include "camera/image_file.hpp"
#include "camera/source_contract.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using camera::Camera;
using camera::Frame;
using ::testing::HasSubstr;

void save(const std::filesystem::path& path, const Camera& camera, std::size_t index,
          std::int64_t number) {
  std::filesystem::create_directories(path.parent_path());
  std::vector<std::byte> pixels(camera.format.size());
  fill_pattern(pixels, index, number);
  std::ofstream(path, std::ios::binary) << camera::encode_png(camera.format, pixels);
}

TEST(FolderSource, ShowsTheImagesOfEachCameraInTheOrderOfTheirNumbers) {
  const Folder folder;
  const std::vector<Camera> cameras = three_cameras();
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::int64_t i = 0; i < 12; ++i) {
      // One camera in a folder of its own, the others by their names. "10" comes after "9".
      const std::string number = std::to_string(i);
      save(c == 1 ? folder.path() / cameras[c].name / ("image" + number + ".png")
                  : folder.path() / (cameras[c].name + "_" + number + ".png"),
           cameras[c], c, i);
    }
  }
  camera::FolderSource source(
      cameras, {.folder = folder.path(), .period = 100us, .repeats = false, .keeps_pace = false});
  Grabbed grabbed(source);
  Instant last{};
  for (std::int64_t i = 0; i < 12; ++i) {
    ASSERT_TRUE(source.grab(grabbed.images, grabbed.frames, kForever));
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(grabbed.frames[c].state, Frame::State::kGood);
      EXPECT_EQ(grabbed.frames[c].number, i);
      EXPECT_TRUE(has_pattern(grabbed.images[c], c, i));
    }
    if (i > 0) {
      EXPECT_EQ(grabbed.frames[0].time - last, 100us);
    }
    last = grabbed.frames[0].time;
  }
  EXPECT_TRUE(source.has_ended());
  EXPECT_FALSE(source.grab(grabbed.images, grabbed.frames, kForever));
}

TEST(FolderSource, fault_52_LeavesOutWhatASlowReaderHasMissed) {
  const Folder folder;
  const std::vector<Camera> cameras = three_cameras();
  constexpr std::int64_t kImages = 5;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::int64_t i = 0; i < kImages; ++i) {
      save(folder.path() / (cameras[c].name + "_" + std::to_string(i) + ".png"), cameras[c], c, i);
    }
  }
  for (const bool repeats : {true, false}) {
    camera::FolderSource source(cameras,
                                {.folder = folder.path(), .period = 10ms, .repeats = repeats});
    Grabbed grabbed(source);
    Instant begin{};
    std::int64_t number = -1;
    while (number < 20 && !source.has_ended()) {
      const Instant before = std::chrono::steady_clock::now();
      ASSERT_TRUE(source.grab(grabbed.images, grabbed.frames, kForever));
      const Frame& frame = grabbed.frames[0];
      if (number < 0) begin = frame.time;
      EXPECT_GT(frame.number, number);
      number = frame.number;
      EXPECT_EQ(frame.time, begin + number * 10ms);
      EXPECT_TRUE(has_pattern(grabbed.images[0], 0, number % kImages));
      const bool is_last = !repeats && number == kImages - 1;
      if (!is_last) {
        EXPECT_GT(frame.time, before - 10ms) << "there was a newer one";
      }
      std::this_thread::sleep_for(25ms);  // as its work takes it
    }
    EXPECT_EQ(number >= 20, repeats);
  }
}

TEST(FolderSource, KeepsTheTimesInNames) {
  const Folder folder;
  const std::vector<Camera> cameras = three_cameras();
  const std::vector<std::int64_t> times{1'000'000'000'000, 1'000'000'500'000, 1'000'000'700'000};
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (c == 2 && i == 1) continue;  // this one has no such image
      save(folder.path() / cameras[c].name / (std::to_string(times[i]) + ".png"), cameras[c], c,
           static_cast<std::int64_t>(i));
    }
  }
  camera::FolderSource source(
      cameras, {.folder = folder.path(), .period = 1ms, .repeats = true, .keeps_pace = false});
  Grabbed grabbed(source);
  std::vector<Instant> shown;
  for (std::int64_t i = 0; i < 6; ++i) {
    ASSERT_TRUE(source.grab(grabbed.images, grabbed.frames, kForever));
    shown.push_back(grabbed.frames[0].time);
    EXPECT_TRUE(has_pattern(grabbed.images[0], 0, i % 3));
    EXPECT_EQ(grabbed.frames[2].state, i % 3 == 1 ? Frame::State::kNone : Frame::State::kGood);
    EXPECT_EQ(grabbed.frames[0].number, i);
  }
  EXPECT_EQ(shown[1] - shown[0], 500us);
  EXPECT_EQ(shown[2] - shown[0], 700us);
  EXPECT_EQ(shown[3] - shown[0], 1700us);
  EXPECT_FALSE(source.has_ended());
}

TEST(FolderSource, fault_53_AnImageThatCannotBeReadIsDamaged) {
  const Folder folder;
  const std::vector<Camera> cameras = three_cameras();
  for (std::size_t c = 0; c < 3; ++c)
    save(folder.path() / (cameras[c].name + ".png"), cameras[c], c, 0);
  std::filesystem::resize_file(folder.path() / "camera180.png", 100);
  save(folder.path() / "camera300.png", three_cameras(camera::PixelFormat::kMono8, 8)[0], 2, 0);
  camera::FolderSource source(cameras, {.folder = folder.path(), .period = 100us});
  Grabbed grabbed(source);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(source.grab(grabbed.images, grabbed.frames, kForever));
    EXPECT_EQ(grabbed.frames[0].state, Frame::State::kGood);
    EXPECT_EQ(grabbed.frames[1].state, Frame::State::kDamaged);
    EXPECT_EQ(grabbed.frames[2].state, Frame::State::kDamaged);
  }
  EXPECT_THAT(source.take_messages(),
              ::testing::ElementsAre(
                  HasSubstr("camera180.png: the PNG image is damaged: it is cut off"),
                  HasSubstr("camera300.png: the image has 8 x 8 pixels, must have 32 x 32")));
}

SourceUnderTest make_folder_source() {
  const auto folder = std::make_shared<Folder>();
  const std::vector<Camera> cameras = three_cameras();
  for (std::size_t c = 0; c < 3; ++c) {
    save(folder->path() / (cameras[c].name + ".png"), cameras[c], c, 0);
  }
  return {.world = folder,
          .source = std::make_unique<camera::FolderSource>(
              cameras, camera::FolderOptions{.folder = folder->path(), .period = 5ms})};
}

INSTANTIATE_TEST_SUITE_P(Folder, SourceContract, ::testing::Values(&make_folder_source));

TEST(FolderSource, WaitsNoLongerThanItWasTold) {
  const Folder folder;
  const std::vector<Camera> cameras = three_cameras();
  for (std::size_t c = 0; c < 3; ++c)
    save(folder.path() / (cameras[c].name + ".png"), cameras[c], c, 0);
  camera::FolderSource source(cameras, {.folder = folder.path(), .period = 1h});
  Grabbed grabbed(source);
  EXPECT_TRUE(source.grab(grabbed.images, grabbed.frames, 1ms));
  EXPECT_FALSE(source.grab(grabbed.images, grabbed.frames, 1ms));
  EXPECT_FALSE(source.has_ended());
}

TEST(FolderSource, WithoutImagesOfACameraIsRefused) {
  const Folder folder;
  const std::vector<Camera> cameras = three_cameras();
  save(folder.path() / "camera60_1.png", cameras[0], 0, 0);
  save(folder.path() / "camera1800_1.png", cameras[0], 0, 0);
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { camera::FolderSource(cameras, {.folder = folder.path()}); }),
              HasSubstr("has no images of camera180: neither a subfolder of this name nor files "
                        "like camera180_1.png"));
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { camera::FolderSource(cameras, {.folder = folder.path() / "nothing"}); }),
              HasSubstr("is no folder with images"));
}

}  // namespace
}  // namespace trifinger::test
