// SPDX-License-Identifier: BSD-3-Clause
#include "camera/aravis_device.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "camera/aravis.hpp"
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
  const auto messages = device.take_messages();
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_THAT(messages.front(), HasSubstr("camera '40012345' is not there"));
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
  EXPECT_THAT(other.take_messages().front(), HasSubstr("'Fake_2' is not there; there are"));
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

// What a camera at the network needs for its images.
struct Wanted {
  std::size_t size;
  void* camera;
  int (*read)(void*, std::uint32_t, std::uint32_t*);
};

// A camera at the network, in a process of its own. It writes its pattern into each image, and
// loses this share of its packets. The number of the pattern is 5, and more if images begin
// elsewhere on the sensor.
ChildProcess network_camera(const std::string& serial, double lost, std::size_t size) {
  return ChildProcess([serial, lost, size] {
    // There is one port for all tests of this machine (tests/python/test_cameras.py has one, too).
    const auto lock = std::filesystem::temp_directory_path() / "trifinger_network_camera.lock";
    const int file = ::open(lock.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
    while (::flock(file, LOCK_EX) != 0 && errno == EINTR) {
    }
    const camera::Aravis& aravis = camera::Aravis::instance();
    const camera::Library library("libaravis-0.8.so.0", "a test", "");
    void* (*make)(const char*, const char*, const char*) = nullptr;
    library.find("arv_gv_fake_camera_new_full", make);
    void* (*inner)(void*) = nullptr;
    library.find("arv_gv_fake_camera_get_fake_camera", inner);
    using Pattern = void (*)(void*, void*, std::uint32_t, std::uint32_t, std::uint32_t);
    void (*set_pattern)(void*, Pattern, void*) = nullptr;
    library.find("arv_fake_camera_set_fill_pattern", set_pattern);
    Wanted needed{.size = size, .camera = nullptr, .read = nullptr};
    library.find("arv_fake_camera_read_register", needed.read);
    int (*is_running)(void*) = nullptr;
    library.find("arv_gv_fake_camera_is_running", is_running);
    void* const camera = make("127.0.0.1", serial.c_str(), nullptr);
    if (camera == nullptr || is_running(camera) == 0) return 2;
    needed.camera = inner(camera);
    if (lost > 0) aravis.object_set(camera, "gvsp-lost-ratio", lost, nullptr);
    set_pattern(
        inner(camera),
        [](void* buffer, void* wanted, std::uint32_t, std::uint32_t, std::uint32_t) {
          const auto& [its_size, its_camera, read] = *static_cast<const Wanted*>(wanted);
          std::uint32_t x = 0;
          std::uint32_t y = 0;
          read(its_camera, 0x130, &x);  // the registers of its offset
          read(its_camera, 0x134, &y);
          std::size_t received = 0;  // nothing yet
          const void* const data = camera::Aravis::instance().buffer_data(buffer, &received);
          fill_pattern({static_cast<std::byte*>(const_cast<void*>(data)), its_size}, 1,
                       5 + x + 10 * y);
        },
        &needed);
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
    static_cast<void>(device.take_messages());
    Frame frame;
    while (device.is_there()) static_cast<void>(device.grab(pixels, frame, 100ms));
    EXPECT_THAT(device.take_messages().front(), HasSubstr("delivers nothing any more: it is lost"));
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

TEST(AravisNetworkCamera, fault_52_ImagesOfWhichNothingArrivedAreCounted) {
  // Most packets are lost, so of many images nothing comes at all.
  const auto wanted = settings(serial_number(), PixelFormat::kMono8, 16);
  std::vector<std::byte> pixels(wanted.format.size());
  const ChildProcess process = network_camera(serial_number(), 0.7, wanted.format.size());
  camera::AravisDevice device(wanted);
  connect(device, pixels);
  Frame last;
  int gaps = 0;
  while (gaps < 3) {
    Frame frame;
    if (!device.grab(pixels, frame, 100ms)) continue;
    EXPECT_GT(frame.number, last.number);
    EXPECT_GT(frame.time, last.time);
    EXPECT_LE(frame.time, std::chrono::steady_clock::now());
    if (last.number >= 0 && frame.number > last.number + 1) ++gaps;
    last = frame;
  }
}

// Waits until one of its sentences has this text.
std::string await(camera::AravisDevice& device, std::vector<std::byte>& pixels,
                  const std::string& text) {
  Frame frame;
  while (true) {
    for (const std::string& sentence : device.take_messages()) {
      if (sentence.find(text) != std::string::npos) return sentence;
    }
    static_cast<void>(device.grab(pixels, frame, 100ms));
  }
}

camera::AravisSettings any_network_camera(int size) {
  auto wanted = settings("any", PixelFormat::kMono8, size);
  // Other tests of this process may have asked for the library's own camera.
  wanted.claims = std::make_shared<camera::Claims>(std::set<std::string>{"Fake_1"});
  return wanted;
}

TEST(AravisNetworkCamera, fault_54_AnotherOneIsNotTakenForTheOneThatWasThereFirst) {
  const auto wanted = any_network_camera(64);
  std::vector<std::byte> pixels(wanted.format.size());
  std::optional<camera::AravisDevice> device;
  {
    const ChildProcess first = network_camera(serial_number(), 0, wanted.format.size());
    device.emplace(wanted);
    connect(*device, pixels);
    EXPECT_THAT(await(*device, pixels, "any camera"),
                HasSubstr("it is '" + serial_number() + "' from now on"));
    EXPECT_GE(next(*device, pixels).number, 0);
    // Nobody else gets it.
    camera::AravisDevice second(wanted);
    EXPECT_FALSE(second.is_there());
    EXPECT_THAT(second.take_messages().front(), HasSubstr("no camera is free"));
  }
  await(*device, pixels, "is lost");
  {
    const ChildProcess other = network_camera(serial_number() + "X", 0, wanted.format.size());
    EXPECT_THAT(await(*device, pixels, serial_number() + "X"),
                HasSubstr("camera '" + serial_number() + "' is not there; there are"));
    EXPECT_FALSE(device->is_there());
  }
  const ChildProcess again = network_camera(serial_number(), 0, wanted.format.size());
  await(*device, pixels, "is connected");
}

TEST(AravisNetworkCamera, fault_51_OneThatCannotBeOpenedIsLeftForAnotherOne) {
  // The library's own camera is the first one in the list. From now on it describes itself as one
  // that can do nothing.
  const camera::Library library("libaravis-0.8.so.0", "a test", "");
  void (*describe)(const char*) = nullptr;
  library.find("arv_set_fake_camera_genicam_filename", describe);
  const auto wanted = settings("any", PixelFormat::kMono8, 64);
  std::vector<std::byte> pixels(wanted.format.size());
  const ChildProcess process = network_camera(serial_number(), 0, wanted.format.size());
  camera::Aravis::instance().enable_interface("Fake");
  const auto description = std::filesystem::path(::testing::TempDir()) / (serial_number() + ".xml");
  std::ofstream(description) << "<RegisterDescription></RegisterDescription>";
  describe(description.c_str());
  std::optional<camera::AravisDevice> device;
  while (!device) {
    try {
      device.emplace(wanted);
    } catch (const InvalidArgument& error) {
      // The other one is not found yet.
      EXPECT_THAT(error.what(), HasSubstr("camera 'Fake_1' has no images in mono8"));
    }
  }
  EXPECT_THAT(await(*device, pixels, "any camera"),
              HasSubstr("it is '" + serial_number() + "' from now on"));
  EXPECT_TRUE(device->is_there());
  describe(nullptr);
  std::filesystem::remove(description);
}

TEST(AravisNetworkCamera, fault_54_ItsImagesBeginAtTheSamePixelAfterItWasWithoutPower) {
  auto wanted = settings(serial_number(), PixelFormat::kMono8, 64);
  std::vector<std::byte> pixels(wanted.format.size());
  const auto expect_offset = [&](camera::AravisDevice& device, int x, int y) {
    for (Frame frame; frame.state != Frame::State::kGood;) {
      static_cast<void>(device.grab(pixels, frame, 100ms));
    }
    EXPECT_TRUE(has_pattern(pixels, 1, 5 + x + 10 * y));
  };
  std::optional<camera::AravisDevice> device;
  {
    const ChildProcess process = network_camera(serial_number(), 0, wanted.format.size());
    wanted.offset = {4, 2};
    {
      camera::AravisDevice configured(wanted);
      connect(configured, pixels);
      expect_offset(configured, 4, 2);
    }
    // The camera has it now. Whoever says nothing leaves it there.
    wanted.offset.reset();
    device.emplace(wanted);
    connect(*device, pixels);
    expect_offset(*device, 4, 2);
  }
  await(*device, pixels, "is lost");
  const ChildProcess again = network_camera(serial_number(), 0, wanted.format.size());
  connect(*device, pixels);
  expect_offset(*device, 4, 2);
}

TEST(AravisNetworkCamera, fault_51_WhatHindersItsReturnIsToldOnceAndEndsNothing) {
  const auto wanted = settings(serial_number(), PixelFormat::kMono8, 64);
  std::vector<std::byte> pixels(wanted.format.size());
  camera::AravisDevice device(wanted);  // it is not there yet
  const ChildProcess process = network_camera(serial_number(), 0, wanted.format.size());
  {
    // Another program is faster, so nobody else can set the camera.
    camera::AravisDevice faster(wanted);
    connect(faster, pixels);
    await(device, pixels, "camera '");
    await(device, pixels, "camera '");
    Frame frame;
    EXPECT_FALSE(device.grab(pixels, frame, 100ms));
    EXPECT_FALSE(device.is_there());
  }
  await(device, pixels, "is connected");
}

}  // namespace
}  // namespace trifinger::test
