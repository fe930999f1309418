// SPDX-License-Identifier: BSD-3-Clause
#include "camera/video_device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "camera/cameras_of_tests.hpp"
#include "camera/image_file.hpp"
#include "camera/source_contract.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"

// A driver of Video4Linux as an object: the calls of the system end here.

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using camera::Frame;
using camera::ImageFormat;
using camera::PixelFormat;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A webcam with one format and size.
class FakeVideo final : public camera::VideoSystem {
 public:
  struct Image {
    std::vector<std::byte> bytes;
    std::uint32_t flags{V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE};
  };

  FakeVideo(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height)
      : fourcc_(fourcc), width_(width), height_(height) {}

  [[nodiscard]] int open(const std::string& path) override {
    if (path == "/dev/video3" && is_plugged) return ++opened;
    errno = ENOENT;
    return -1;
  }
  void close(int) override { ++closed; }
  [[nodiscard]] std::string serial_of(const std::string&) override { return serial; }
  [[nodiscard]] bool wait(int, Timeout timeout) override {
    if (rate > 0) {
      // Delivers by itself.
      const Instant due = begin_ + Nanoseconds(1s) * (count_ + 1) / rate;
      const Instant now = std::chrono::steady_clock::now();
      std::this_thread::sleep_for(std::min<Nanoseconds>(due - now, timeout));
      if (due - now > timeout) return false;
      ++count_;
      add([](unsigned, unsigned) { return std::vector{1}; });
      sequence = static_cast<std::uint32_t>(count_);
      stamp = due;
    }
    if (is_plugged && images.empty()) std::this_thread::sleep_for(timeout);
    return !is_plugged || !images.empty();
  }
  [[nodiscard]] std::byte* map(int, std::size_t size, std::size_t offset) override {
    auto& memory = memory_[offset];
    memory.resize(size);
    ++mapped;
    return memory.data();
  }
  void unmap(std::byte*, std::size_t) override { --mapped; }

  [[nodiscard]] int ioctl(int, unsigned long request, void* argument) override {
    if (!is_plugged) return fail(ENODEV);
    switch (request) {
      case VIDIOC_QUERYCAP: {
        auto& answer = *static_cast<v4l2_capability*>(argument);
        std::strcpy(reinterpret_cast<char*>(answer.card), "Fake Webcam");
        std::strcpy(reinterpret_cast<char*>(answer.bus_info), port.c_str());
        answer.capabilities = V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE;
        answer.device_caps = caps;
        return 0;
      }
      case VIDIOC_ENUM_FMT: {
        auto& answer = *static_cast<v4l2_fmtdesc*>(argument);
        if (answer.index > 0) return fail(EINVAL);
        answer.pixelformat = fourcc_;
        return 0;
      }
      case VIDIOC_S_FMT: {
        // A driver answers with the nearest that it can do.
        auto& format = static_cast<v4l2_format*>(argument)->fmt.pix;
        format.pixelformat = fourcc_;
        format.width = width_;
        format.height = height_;
        format.bytesperline = stride();
        return 0;
      }
      case VIDIOC_S_PARM:
        period = 1us * static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe.numerator;
        return 0;
      case VIDIOC_S_CTRL: {
        const auto& control = *static_cast<v4l2_control*>(argument);
        controls[control.id] = control.value;
        return 0;
      }
      case VIDIOC_REQBUFS:
        static_cast<v4l2_requestbuffers*>(argument)->count = 2;
        return 0;
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.length = 3 * width_ * height_ + 4096;
        buffer.m.offset = buffer.index * 65536;
        return 0;
      }
      case VIDIOC_QBUF:
        queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
        return 0;
      case VIDIOC_DQBUF: {
        if (images.empty() || queued.empty()) return fail(EAGAIN);
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.index = queued.front();
        queued.pop_front();
        const Image& image = images.front();
        std::memcpy(memory_[buffer.index * 65536].data(), image.bytes.data(), image.bytes.size());
        buffer.bytesused = static_cast<std::uint32_t>(image.bytes.size());
        buffer.flags = image.flags;
        buffer.sequence = sequence++;
        const auto since =
            std::chrono::duration_cast<std::chrono::microseconds>(stamp.time_since_epoch());
        buffer.timestamp = {.tv_sec = since / 1s, .tv_usec = (since % 1s).count()};
        images.pop_front();
        return 0;
      }
      default:
        return 0;
    }
  }

  [[nodiscard]] std::uint32_t stride() const {
    const std::uint32_t size = fourcc_ == V4L2_PIX_FMT_YUYV                                     ? 2
                               : fourcc_ == V4L2_PIX_FMT_BGR24 || fourcc_ == V4L2_PIX_FMT_RGB24 ? 3
                                                                                                : 1;
    return size * width_ + (fourcc_ == V4L2_PIX_FMT_MJPEG ? 0 : 6);  // rows have gaps
  }
  // An image whose pixels `pixel(x, y)` gives as bytes.
  template <class Pixel>
  void add(const Pixel& pixel) {
    Image image;
    image.bytes.resize(std::size_t{stride()} * height_);
    for (std::uint32_t y = 0; y < height_; ++y) {
      std::size_t place = std::size_t{y} * stride();
      for (std::uint32_t x = 0; x < width_; ++x) {
        for (const int byte : pixel(x, y)) image.bytes[place++] = static_cast<std::byte>(byte);
      }
    }
    images.push_back(std::move(image));
  }

  bool is_plugged{true};
  std::string port{"usb-1"};
  std::string serial;
  std::uint32_t caps{V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING};
  std::deque<Image> images;
  std::deque<std::uint32_t> queued;
  std::map<std::uint32_t, std::int32_t> controls;
  Nanoseconds period{0};
  std::uint32_t sequence{7};
  Instant stamp{5s + 2ms};
  int rate{0};  // images per second; 0: those that the test adds
  int opened{0};
  int closed{0};
  int mapped{0};

 private:
  static int fail(int number) {
    errno = number;
    return -1;
  }

  Instant begin_{std::chrono::steady_clock::now()};
  std::int64_t count_{0};
  std::uint32_t fourcc_;
  std::uint32_t width_;
  std::uint32_t height_;
  std::map<std::size_t, std::vector<std::byte>> memory_;
};

// Several webcams at paths that may change.
class FakePaths final : public camera::VideoSystem {
 public:
  [[nodiscard]] int open(const std::string& path) override {
    const auto found = at.find(path);
    if (found == at.end()) {
      errno = ENOENT;
      return -1;
    }
    files_.push_back(found->second);
    return static_cast<int>(files_.size()) - 1;
  }
  void close(int) override {}
  [[nodiscard]] std::string serial_of(const std::string& path) override {
    return at.at(path)->serial;
  }
  [[nodiscard]] int ioctl(int file, unsigned long request, void* argument) override {
    return of(file).ioctl(file, request, argument);
  }
  [[nodiscard]] std::byte* map(int file, std::size_t size, std::size_t offset) override {
    return of(file).map(file, size, offset);
  }
  void unmap(std::byte*, std::size_t) override {}
  [[nodiscard]] bool wait(int file, Timeout timeout) override {
    return of(file).wait(file, timeout);
  }

  std::map<std::string, FakeVideo*> at;

 private:
  [[nodiscard]] FakeVideo& of(int file) { return *files_[static_cast<std::size_t>(file)]; }

  std::vector<FakeVideo*> files_;
};

camera::VideoSettings settings(PixelFormat pixels, int width = 4, int height = 2) {
  return {.path = "/dev/video3",
          .format = {.width = width, .height = height, .pixels = pixels},
          .period = 20ms,
          .exposure = 2ms};
}

std::vector<int> grab(camera::VideoDevice& device, const ImageFormat& format,
                      Frame* frame = nullptr) {
  std::vector<std::byte> pixels(format.size());
  Frame found;
  EXPECT_TRUE(device.grab(pixels, found, 0ns));
  if (frame != nullptr) *frame = found;
  std::vector<int> values;
  values.reserve(pixels.size());
  for (const std::byte pixel : pixels) values.push_back(static_cast<int>(pixel));
  return values;
}

TEST(VideoDevice, DeliversBrightnessWithTimeAndNumber) {
  FakeVideo video(V4L2_PIX_FMT_GREY, 4, 2);
  camera::VideoDevice device(settings(PixelFormat::kMono8), video);
  EXPECT_EQ(video.period, 20ms);
  EXPECT_EQ(video.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 20);
  EXPECT_EQ(video.controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
  Frame frame;
  for (int i = 0; i < 5; ++i) {
    video.add(
        [i](unsigned x, unsigned y) { return std::vector{static_cast<int>(10 * y + x) + i}; });
    EXPECT_THAT(grab(device, {.width = 4, .height = 2, .pixels = PixelFormat::kMono8}, &frame),
                ElementsAre(i, 1 + i, 2 + i, 3 + i, 10 + i, 11 + i, 12 + i, 13 + i));
    EXPECT_EQ(frame.state, Frame::State::kGood);
    EXPECT_EQ(frame.number, i);
    EXPECT_EQ(frame.time, Instant(5s + 2ms + 1ms));  // stamped at the beginning of its exposure
    EXPECT_EQ(frame.exposure, 2ms);
  }
}

TEST(VideoDevice, fault_52_ASequenceNumberThatIsMissingIsMissing) {
  FakeVideo video(V4L2_PIX_FMT_GREY, 4, 2);
  camera::VideoDevice device(settings(PixelFormat::kMono8), video);
  Frame frame;
  for (const std::int64_t number : {0, 3, 4}) {
    video.sequence = static_cast<std::uint32_t>(100 + number);
    video.add([](unsigned, unsigned) { return std::vector{1}; });
    grab(device, {.width = 4, .height = 2, .pixels = PixelFormat::kMono8}, &frame);
    EXPECT_EQ(frame.number, number);
  }
}

TEST(VideoDevice, TakesTheMiddleOfLargerImages) {
  FakeVideo video(V4L2_PIX_FMT_RGB24, 10, 8);
  camera::VideoDevice device(settings(PixelFormat::kRgb8), video);
  video.add([](unsigned x, unsigned y) {
    return std::vector{static_cast<int>(x), static_cast<int>(y), 9};
  });
  EXPECT_THAT(grab(device, {.width = 4, .height = 2, .pixels = PixelFormat::kRgb8}),
              ElementsAre(2, 2, 9, 3, 2, 9, 4, 2, 9, 5, 2, 9,  //
                          2, 3, 9, 3, 3, 9, 4, 3, 9, 5, 3, 9));
}

TEST(VideoDevice, KnowsTheOrderOfColours) {
  {
    FakeVideo video(V4L2_PIX_FMT_BGR24, 4, 2);
    camera::VideoDevice device(settings(PixelFormat::kRgb8), video);
    video.add([](unsigned, unsigned) { return std::vector{3, 2, 1}; });
    EXPECT_THAT(
        grab(device, {.width = 4, .height = 2, .pixels = PixelFormat::kRgb8}),
        ElementsAre(1, 2, 3, 1, 2, 3, 1, 2, 3, 1, 2, 3, 1, 2, 3, 1, 2, 3, 1, 2, 3, 1, 2, 3));
  }
  {
    // YUYV: light and two colours. Full red, as BT.601 says: Y 81, U 90, V 240.
    FakeVideo video(V4L2_PIX_FMT_YUYV, 4, 2);
    camera::VideoDevice device(settings(PixelFormat::kRgb8), video);
    video.add([](unsigned x, unsigned) { return std::vector{81, x % 2 == 0 ? 90 : 240}; });
    const auto rgb = grab(device, {.width = 4, .height = 2, .pixels = PixelFormat::kRgb8});
    for (std::size_t i = 0; i < rgb.size(); i += 3) {
      EXPECT_NEAR(rgb[i], 255, 2);
      EXPECT_NEAR(rgb[i + 1], 0, 2);
      EXPECT_NEAR(rgb[i + 2], 0, 2);
    }
  }
  {
    // BA81: the first row is B G, the second one G R.
    FakeVideo video(V4L2_PIX_FMT_SBGGR8, 4, 2);
    camera::VideoDevice device(settings(PixelFormat::kBayerRg8), video);
    video.add([](unsigned x, unsigned y) {
      return std::vector{y % 2 == 0 && x % 2 == 0 ? 30 : y % 2 == 1 && x % 2 == 1 ? 200 : 90};
    });
    EXPECT_THAT(grab(device, {.width = 4, .height = 2, .pixels = PixelFormat::kBayerRg8}),
                ElementsAre(200, 90, 200, 90, 90, 30, 90, 30));
  }
}

TEST(VideoDevice, DecompressesMotionJpeg) {
  const ImageFormat format{.width = 16, .height = 16, .pixels = PixelFormat::kRgb8};
  FakeVideo video(V4L2_PIX_FMT_MJPEG, 16, 16);
  camera::VideoDevice device(settings(PixelFormat::kRgb8, 16, 16), video);
  std::vector<std::byte> rgb;
  for (int i = 0; i < 256; ++i) {
    for (const int value : {220, 40, 80}) rgb.push_back(static_cast<std::byte>(value));
  }
  const std::string jpeg = camera::encode_jpeg(format, rgb, 95);
  const auto* const bytes = reinterpret_cast<const std::byte*>(jpeg.data());
  video.images.push_back({.bytes = {bytes, bytes + jpeg.size()}});
  const auto found = grab(device, format);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_NEAR(found[i], static_cast<int>(rgb[i]), 6);
  }
  // Cut off.
  Frame frame;
  video.images.push_back({.bytes = {bytes, bytes + jpeg.size() / 2}});
  grab(device, format, &frame);
  EXPECT_EQ(frame.state, Frame::State::kDamaged);
}

TEST(VideoDevice, fault_53_ABufferWithAnErrorOrTooFewBytesIsDamaged) {
  FakeVideo video(V4L2_PIX_FMT_GREY, 4, 2);
  camera::VideoDevice device(settings(PixelFormat::kMono8), video);
  const ImageFormat format{.width = 4, .height = 2, .pixels = PixelFormat::kMono8};
  const auto grey = [](unsigned, unsigned) { return std::vector{1}; };
  Frame frame;
  video.add(grey);
  video.images.back().flags |= V4L2_BUF_FLAG_ERROR;
  grab(device, format, &frame);
  EXPECT_EQ(frame.state, Frame::State::kDamaged);
  video.add(grey);
  video.images.back().bytes.resize(10);
  grab(device, format, &frame);
  EXPECT_EQ(frame.state, Frame::State::kDamaged);
  video.add(grey);
  grab(device, format, &frame);
  EXPECT_EQ(frame.state, Frame::State::kGood);
  EXPECT_EQ(frame.number, 2);
}

TEST(VideoDevice, fault_51_ADeviceThatIsUnpluggedIsFoundAgain) {
  FakeVideo video(V4L2_PIX_FMT_GREY, 4, 2);
  camera::VideoDevice device(settings(PixelFormat::kMono8), video);
  const ImageFormat format{.width = 4, .height = 2, .pixels = PixelFormat::kMono8};
  const auto grey = [](unsigned, unsigned) { return std::vector{1}; };
  Frame frame;
  video.add(grey);
  grab(device, format, &frame);
  video.is_plugged = false;
  std::vector<std::byte> pixels(format.size());
  EXPECT_FALSE(device.grab(pixels, frame, 1ms));
  EXPECT_FALSE(device.is_there());
  EXPECT_THAT(device.take_messages(),
              ElementsAre("the camera at /dev/video3 is lost: No such device"));
  EXPECT_EQ(video.opened, video.closed);
  EXPECT_EQ(video.mapped, 0);
  video.is_plugged = true;
  video.images.clear();
  video.queued.clear();
  video.sequence = 0;
  video.add(grey);
  while (!device.grab(pixels, frame, 1s)) {
  }
  EXPECT_TRUE(device.is_there());
  EXPECT_EQ(frame.number, 1);  // goes on, also if the device counts from 0 again
  EXPECT_THAT(device.take_messages(), ElementsAre("the camera at /dev/video3 is back"));
}

TEST(VideoDevice, fault_51_ADeviceThatFallsSilentIsLostAndOpenedAgain) {
  FakeVideo video(V4L2_PIX_FMT_GREY, 4, 2);
  camera::VideoDevice device(settings(PixelFormat::kMono8), video);
  const ImageFormat format{.width = 4, .height = 2, .pixels = PixelFormat::kMono8};
  const auto grey = [](unsigned, unsigned) { return std::vector{1}; };
  video.add(grey);
  const Instant begin = std::chrono::steady_clock::now();  // its silence begins later
  grab(device, format);
  std::vector<std::byte> pixels(format.size());
  Frame frame;
  while (device.is_there()) EXPECT_FALSE(device.grab(pixels, frame, 10ms));
  EXPECT_GT(std::chrono::steady_clock::now() - begin, 1s);
  EXPECT_THAT(device.take_messages(),
              ElementsAre("the camera at /dev/video3 is lost: it delivers nothing any more"));
  EXPECT_EQ(video.opened, video.closed);
  video.queued.clear();
  while (!device.is_there()) EXPECT_FALSE(device.grab(pixels, frame, 10ms));
  video.add(grey);
  while (!device.grab(pixels, frame, 10ms)) {
  }
  EXPECT_THAT(device.take_messages(), ElementsAre("the camera at /dev/video3 is back"));
}

TEST(VideoDevice, fault_52_ImagesAreCountedAsLostAfterItsReturn) {
  FakeVideo video(V4L2_PIX_FMT_GREY, 4, 2);
  camera::VideoDevice device(settings(PixelFormat::kMono8), video);
  std::vector<std::byte> pixels(8);
  Frame frame;
  const auto next_number = [&](std::uint32_t sequence) {
    video.sequence = sequence;
    video.add([](unsigned, unsigned) { return std::vector{1}; });
    while (!device.grab(pixels, frame, 1s)) {
    }
    return frame.number;
  };
  EXPECT_EQ(next_number(0), 0);
  EXPECT_EQ(next_number(1), 1);
  video.is_plugged = false;
  while (device.is_there()) EXPECT_FALSE(device.grab(pixels, frame, 1ms));
  video.is_plugged = true;
  video.queued.clear();
  EXPECT_EQ(next_number(0), 2);
  EXPECT_EQ(next_number(3), 5);  // two are missing
  EXPECT_EQ(next_number(4), 6);
}

TEST(VideoDevice, fault_51_WhatHindersItsReturnIsToldOnceAndEndsNothing) {
  FakeVideo video(V4L2_PIX_FMT_GREY, 4, 2);
  camera::VideoDevice device(settings(PixelFormat::kMono8), video);
  std::vector<std::byte> pixels(8);
  Frame frame;
  video.is_plugged = false;
  EXPECT_FALSE(device.grab(pixels, frame, 0ns));
  static_cast<void>(device.take_messages());
  // It is back, but not as a camera.
  video.is_plugged = true;
  video.caps = V4L2_CAP_STREAMING;
  for (const int before = video.opened; video.opened < before + 3;) {
    EXPECT_FALSE(device.grab(pixels, frame, 1s));
  }
  EXPECT_FALSE(device.is_there());
  EXPECT_THAT(device.take_messages(),
              ElementsAre("/dev/video3 is no camera; 'trifinger cameras --list' shows cameras"));
  EXPECT_EQ(video.opened, video.closed);
  video.caps |= V4L2_CAP_VIDEO_CAPTURE;
  video.queued.clear();
  video.add([](unsigned, unsigned) { return std::vector{1}; });
  while (!device.grab(pixels, frame, 1s)) {
  }
  EXPECT_THAT(device.take_messages(), ElementsAre("the camera at /dev/video3 is back"));
}

TEST(VideoDevice, fault_54_ThatComesBackAtAnotherPathIsFoundAndNoOtherIsTaken) {
  FakeVideo left(V4L2_PIX_FMT_GREY, 4, 2);
  FakeVideo right(V4L2_PIX_FMT_GREY, 4, 2);
  right.port = "usb-2";
  FakePaths paths;
  paths.at = {{"/dev/video3", &left}, {"/dev/video5", &right}};
  camera::VideoDevice device(settings(PixelFormat::kMono8), paths);
  std::vector<std::byte> pixels(8);
  Frame frame;
  const auto unplug = [&] {
    left.is_plugged = false;
    while (device.is_there()) EXPECT_FALSE(device.grab(pixels, frame, 1ms));
    left.is_plugged = true;
    left.queued.clear();
    right.queued.clear();
    static_cast<void>(device.take_messages());
  };
  const auto next_number = [&](FakeVideo& video, int value) {
    video.add([value](unsigned, unsigned) { return std::vector{value}; });
    while (!device.grab(pixels, frame, 1s)) {
    }
    return static_cast<int>(pixels[0]);
  };
  EXPECT_EQ(next_number(left, 1), 1);
  // Only the other one comes back, at the path of this one.
  unplug();
  paths.at = {{"/dev/video3", &right}};
  std::vector<std::string> messages;
  while (messages.empty()) {
    EXPECT_FALSE(device.grab(pixels, frame, 1s));
    messages = device.take_messages();
  }
  EXPECT_THAT(messages,
              ElementsAre("another camera is at /dev/video3: Fake Webcam at usb-2, not Fake "
                          "Webcam at usb-1"));
  // Now this one, too.
  paths.at = {{"/dev/video3", &right}, {"/dev/video9", &left}};
  EXPECT_EQ(next_number(left, 2), 2);
  EXPECT_THAT(device.take_messages(),
              ElementsAre("the camera at /dev/video3 is back, at /dev/video9"));
  // Another one of the same kind at the same port is known by its serial number.
  unplug();
  left.serial = "4711";
  while (messages.size() < 2) {
    EXPECT_FALSE(device.grab(pixels, frame, 1s));
    for (const std::string& sentence : device.take_messages()) messages.push_back(sentence);
  }
  EXPECT_FALSE(device.is_there());
  EXPECT_THAT(messages.back(), HasSubstr("another camera is at /dev/video3"));
}

TEST(VideoDevice, ThatCannotDoItIsRefusedWithASentence) {
  FakeVideo video(V4L2_PIX_FMT_GREY, 2, 2);
  EXPECT_EQ(message_of<InvalidArgument>(
                [&] { camera::VideoDevice(settings(PixelFormat::kMono8), video); }),
            "the camera at /dev/video3 has no images of 4 x 2 pixels or more in a format that is "
            "known here; it has 2 x 2 in GREY");
  video.caps = V4L2_CAP_STREAMING;
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { camera::VideoDevice(settings(PixelFormat::kMono8), video); }),
              HasSubstr("/dev/video3 is no camera"));
  EXPECT_EQ(video.opened, video.closed);
  auto elsewhere = settings(PixelFormat::kMono8);
  elsewhere.path = "/dev/video9";
  camera::VideoDevice absent(elsewhere, video);
  EXPECT_FALSE(absent.is_there());
  EXPECT_THAT(absent.take_messages(),
              ElementsAre("there is no camera at /dev/video9: No such file or directory"));
}

// Three webcams that deliver at 100 Hz.
struct Webcams {
  Webcams() {
    for (int i = 0; i < 3; ++i) {
      videos.push_back(std::make_unique<FakeVideo>(V4L2_PIX_FMT_GREY, 32, 32));
      videos.back()->rate = 100;
    }
  }
  std::vector<std::unique_ptr<FakeVideo>> videos;
};

SourceUnderTest make_webcams() {
  const auto webcams = std::make_shared<Webcams>();
  std::vector<std::unique_ptr<camera::Device>> devices;
  for (const auto& video : webcams->videos) {
    devices.push_back(
        std::make_unique<camera::VideoDevice>(settings(PixelFormat::kMono8, 32, 32), *video));
  }
  return {.world = webcams,
          .source = std::make_unique<camera::CameraGroup>(three_cameras(PixelFormat::kMono8),
                                                          std::move(devices), 10ms)};
}

INSTANTIATE_TEST_SUITE_P(Video, SourceContract, ::testing::Values(&make_webcams));

TEST(VideoDevice, AreListedWithTheirFormats) {
  FakeVideo video(V4L2_PIX_FMT_YUYV, 4, 2);
  const auto devices = camera::list_video_devices(video);
  ASSERT_EQ(devices.size(), 1U);
  EXPECT_EQ(devices[0].id, "/dev/video3");
  EXPECT_EQ(devices[0].name, "Fake Webcam");
  EXPECT_THAT(devices[0].detail, HasSubstr("YUYV"));
}

}  // namespace
}  // namespace trifinger::test
