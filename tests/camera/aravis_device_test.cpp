// SPDX-License-Identifier: BSD-3-Clause
#include "aravis_device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "aravis.hpp"
#include "camera/cameras_of_tests.hpp"
#include "camera/source_contract.hpp"
#include "support/child_process.hpp"

// Cameras that Aravis pretends to have: one in this process, and one at the network interface of
// the machine itself, in a process that can be killed.

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using camera::Frame;
using camera::PixelFormat;
using ::testing::HasSubstr;

camera::AravisSettings settings(const std::string& device, PixelFormat pixels, int size) {
  return {.device = device,
          .format = {.width = size, .height = size, .pixels = pixels},
          .period = 20ms,
          .exposure = 2ms};
}

Frame next(camera::AravisDevice& device, std::vector<std::byte>& pixels) {
  Frame frame;
  while (!device.grab(pixels, frame, 100ms)) {
  }
  return frame;
}

TEST(AravisDevice, DeliversImagesInOrder) {
  for (const PixelFormat format :
       {PixelFormat::kMono8, PixelFormat::kBayerRg8, PixelFormat::kRgb8}) {
    const auto wanted = settings("Fake_1", format, 64);
    camera::AravisDevice device(wanted);
    ASSERT_TRUE(device.is_there());
    std::vector<std::byte> pixels(wanted.format.size());
    Instant last{};
    for (int i = 0; i < 5; ++i) {
      const Frame frame = next(device, pixels);
      EXPECT_EQ(frame.state, Frame::State::kGood);
      EXPECT_GE(frame.number, i);
      EXPECT_GT(frame.time, last);
      EXPECT_LE(frame.time, std::chrono::steady_clock::now());
      EXPECT_NE(std::ranges::max(pixels), std::ranges::min(pixels));
      last = frame.time;
    }
  }
}

TEST(AravisDevice, fault_51_ThatIsNotThereIsNamedAndLookedFor) {
  camera::AravisDevice device(settings("40012345", PixelFormat::kMono8, 64));
  EXPECT_FALSE(device.is_there());
  const auto news = device.take_news();
  ASSERT_EQ(news.size(), 1U);
  EXPECT_THAT(news.front(), HasSubstr("camera '40012345' is not there"));
  std::vector<std::byte> pixels(64 * 64);
  Frame frame;
  EXPECT_FALSE(device.grab(pixels, frame, 1ms));
}

TEST(AravisDevice, fault_54_IsFoundByItsSerialNumberAndNoOther) {
  // Two cameras, and whoever asks for another one gets none.
  camera::AravisDevice one(settings("Fake_1", PixelFormat::kMono8, 64));
  camera::AravisDevice other(settings("Fake_2", PixelFormat::kMono8, 64));
  EXPECT_TRUE(one.is_there());
  EXPECT_FALSE(other.is_there());
  EXPECT_THAT(other.take_news().front(), HasSubstr("'Fake_2' is not there; there are"));
}

SourceUnderTest make_pretended_cameras() {
  std::vector<std::unique_ptr<camera::Device>> devices;
  devices.reserve(3);
  for (int i = 0; i < 3; ++i) {
    // There is only one pretended camera, but it may be opened often.
    devices.push_back(
        std::make_unique<camera::AravisDevice>(settings("Fake_1", PixelFormat::kBayerRg8, 32)));
  }
  return {
      .world = nullptr,
      .source = std::make_unique<camera::CameraGroup>(three_cameras(), std::move(devices), 20ms)};
}

INSTANTIATE_TEST_SUITE_P(Aravis, SourceContract, ::testing::Values(&make_pretended_cameras));

// A camera at the network, in a process of its own. It writes its pattern into each image, and
// loses this share of its packets.
ChildProcess network_camera(const std::string& serial, double lost, std::size_t size) {
  return ChildProcess([serial, lost, size] {
    const camera::Aravis& aravis = camera::Aravis::instance();
    const camera::Library library("libaravis-0.8.so.0", "a test", "");
    void* (*make)(const char*, const char*, const char*) = nullptr;
    library.find("arv_gv_fake_camera_new_full", make);
    void* (*inner)(void*) = nullptr;
    library.find("arv_gv_fake_camera_get_fake_camera", inner);
    using Pattern = void (*)(void*, void*, std::uint32_t, std::uint32_t, std::uint32_t);
    void (*set_pattern)(void*, Pattern, void*) = nullptr;
    library.find("arv_fake_camera_set_fill_pattern", set_pattern);
    int (*is_running)(void*) = nullptr;
    library.find("arv_gv_fake_camera_is_running", is_running);
    void* const camera = make("127.0.0.1", serial.c_str(), nullptr);
    if (camera == nullptr || is_running(camera) == 0) return 2;
    if (lost > 0) aravis.object_set(camera, "gvsp-lost-ratio", lost, nullptr);
    set_pattern(
        inner(camera),
        [](void* buffer, void* wanted, std::uint32_t, std::uint32_t, std::uint32_t) {
          std::size_t received = 0;  // nothing yet
          const void* const data = camera::Aravis::instance().buffer_data(buffer, &received);
          fill_pattern({static_cast<std::byte*>(const_cast<void*>(data)),
                        *static_cast<const std::size_t*>(wanted)},
                       1, 5);
        },
        const_cast<std::size_t*>(&size));
    for (;;) ::pause();
    return 0;
  });
}

// A serial number that no other test uses at the same time.
std::string serial_number() { return "T" + std::to_string(::getpid()); }

void connect(camera::AravisDevice& device, std::vector<std::byte>& pixels) {
  Frame frame;
  while (!device.is_there()) static_cast<void>(device.grab(pixels, frame, 10ms));
}

TEST(AravisNetworkCamera, fault_51_AndItsImagesComeAgainAfterItWasLost) {
  const auto wanted = settings(serial_number(), PixelFormat::kBayerRg8, 128);
  std::vector<std::byte> pixels(wanted.format.size());
  camera::AravisDevice device(wanted);
  std::int64_t number = -1;
  for (int life = 0; life < 2; ++life) {
    ChildProcess process = network_camera(serial_number(), 0, wanted.format.size());
    connect(device, pixels);
    for (int good = 0; good < 5;) {
      Frame frame;
      if (!device.grab(pixels, frame, 100ms)) continue;
      EXPECT_GT(frame.number, number);
      number = frame.number;
      if (frame.state != Frame::State::kGood) continue;
      EXPECT_TRUE(has_pattern(pixels, 1, 5));
      ++good;
    }
    process.kill();
    static_cast<void>(device.take_news());
    Frame frame;
    while (device.is_there()) static_cast<void>(device.grab(pixels, frame, 100ms));
    EXPECT_THAT(device.take_news().front(), HasSubstr("delivers nothing any more: it is lost"));
  }
}

TEST(AravisNetworkCamera, fault_53_AnImageWithLostPacketsIsDamaged) {
  const auto wanted = settings(serial_number(), PixelFormat::kMono8, 256);
  std::vector<std::byte> pixels(wanted.format.size());
  const ChildProcess process = network_camera(serial_number(), 0.02, wanted.format.size());
  camera::AravisDevice device(wanted);
  connect(device, pixels);
  int good = 0;
  int damaged = 0;
  while (good < 3 || damaged < 3) {
    Frame frame;
    if (!device.grab(pixels, frame, 100ms)) continue;
    if (frame.state == Frame::State::kDamaged) {
      ++damaged;
    } else {
      ++good;
      EXPECT_TRUE(has_pattern(pixels, 1, 5));
    }
  }
}

}  // namespace
}  // namespace trifinger::test
