// SPDX-License-Identifier: BSD-3-Clause
#include "video_device.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <thread>
#include <utility>

#include "base/text_of.hpp"
#include "camera/image_file.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/pixels.hpp"

namespace trifinger::camera {
namespace {

using trifinger::detail::text_of;

class MachineVideo final : public VideoSystem {
 public:
  [[nodiscard]] int open(const std::string& path) override {
    return ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  }
  void close(int file) override { ::close(file); }
  [[nodiscard]] std::string serial_of(const std::string& path) override {
    // The device of a video node is an interface of a USB device.
    std::error_code error;
    const std::filesystem::path node = std::filesystem::canonical(path, error).filename();
    std::ifstream file("/sys/class/video4linux" / node / "device/../serial");
    std::string serial;
    std::getline(file, serial);
    return serial;
  }
  [[nodiscard]] int ioctl(int file, unsigned long request, void* argument) override {
    int result = 0;
    do {
      result = ::ioctl(file, request, argument);
    } while (result < 0 && errno == EINTR);
    return result;
  }
  [[nodiscard]] std::byte* map(int file, std::size_t size, std::size_t offset) override {
    void* const memory =
        ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, static_cast<off_t>(offset));
    return memory == MAP_FAILED ? nullptr : static_cast<std::byte*>(memory);
  }
  void unmap(std::byte* memory, std::size_t size) override { ::munmap(memory, size); }
  [[nodiscard]] bool wait(int file, Timeout timeout) override {
    pollfd event{.fd = file, .events = POLLIN, .revents = 0};
    const auto milliseconds = std::chrono::ceil<std::chrono::milliseconds>(
        std::min<Nanoseconds>(timeout, std::chrono::hours(1)));
    return ::poll(&event, 1, static_cast<int>(milliseconds.count())) > 0;
  }
};

constexpr std::uint32_t kVideoBuffers = 4;
constexpr Nanoseconds kVideoRetry = std::chrono::milliseconds(500);
constexpr Nanoseconds kVideoSilence = std::chrono::seconds(1);

// What cameras may deliver, the best first: what is wanted, then colours, then what costs most
// time.
std::vector<std::uint32_t> formats_for(PixelFormat wanted) {
  switch (wanted) {
    case PixelFormat::kMono8:
      return {V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG};
    case PixelFormat::kBayerRg8:
      return {V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SBGGR8, V4L2_PIX_FMT_RGB24,
              V4L2_PIX_FMT_BGR24,  V4L2_PIX_FMT_YUYV,   V4L2_PIX_FMT_MJPEG};
    case PixelFormat::kRgb8:
      break;
  }
  return {V4L2_PIX_FMT_RGB24, V4L2_PIX_FMT_BGR24,  V4L2_PIX_FMT_YUYV,
          V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SBGGR8};
}

std::string name_of_fourcc(std::uint32_t fourcc) {
  std::string name;
  for (int shift = 0; shift < 32; shift += 8) name += static_cast<char>(fourcc >> shift & 0xffU);
  return name;
}

std::size_t bytes_per_pixel(std::uint32_t fourcc) {
  switch (fourcc) {
    case V4L2_PIX_FMT_YUYV:
      return 2;
    case V4L2_PIX_FMT_RGB24:
    case V4L2_PIX_FMT_BGR24:
      return 3;
    default:
      return 1;
  }
}

std::vector<std::string> video_paths() {
  constexpr int kMaxNodes = 64;
  std::vector<std::string> paths;
  paths.reserve(kMaxNodes);
  for (int i = 0; i < kMaxNodes; ++i) paths.push_back(text_of("/dev/video", i));
  return paths;
}

std::uint32_t capabilities_of(const v4l2_capability& found) {
  return (found.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? found.device_caps : found.capabilities;
}

template <std::size_t N>
std::string text(const __u8 (&bytes)[N]) {
  const auto* const begin = reinterpret_cast<const char*>(bytes);
  return {begin, ::strnlen(begin, N)};
}

std::uint8_t clipped(int value) { return static_cast<std::uint8_t>(std::clamp(value, 0, 255)); }

// ITU-R BT.601 with the range 16 to 235, as webcams deliver it; in 256ths.
void write_rgb(int y, int u, int v, std::uint8_t* rgb) {
  const int light = 298 * (y - 16) + 128;
  rgb[0] = clipped((light + 409 * (v - 128)) / 256);
  rgb[1] = clipped((light - 100 * (u - 128) - 208 * (v - 128)) / 256);
  rgb[2] = clipped((light + 516 * (u - 128)) / 256);
}

}  // namespace

VideoSystem& VideoSystem::machine() {
  static MachineVideo machine;
  return machine;
}

VideoDevice::VideoDevice(VideoSettings settings, VideoSystem& system)
    : settings_(std::move(settings)), system_(system), path_(settings_.path) {
  try {
    open();
  } catch (const InvalidArgument&) {
    throw;
  } catch (const Error& error) {
    report(error.what());
  }
}

VideoDevice::~VideoDevice() { close(); }

std::vector<std::string> VideoDevice::take_messages() { return std::exchange(messages_, {}); }

int VideoDevice::call(unsigned long request, void* argument) {
  return system_.ioctl(file_, request, argument);
}

void VideoDevice::report(const std::string& error) {
  if (throttle_.is_due(error, std::chrono::steady_clock::now())) messages_.push_back(error);
}

void VideoDevice::open() {
  try {
    find();
    choose_format();
    set_rate_and_exposure();
    start();
  } catch (...) {
    close();
    throw;
  }
}

void VideoDevice::find() {
  std::vector<std::string> paths{path_, settings_.path};
  if (!identity_.empty()) {
    for (const std::string& path : video_paths()) paths.push_back(path);
  }
  std::string problem;
  for (const std::string& path : paths) {
    file_ = system_.open(path);
    if (file_ < 0) {
      if (problem.empty()) {
        problem = "there is no camera at " + settings_.path + ": " + std::strerror(errno);
      }
      continue;
    }
    std::string found;
    try {
      found = look_at(path);
    } catch (const Error& error) {
      if (identity_.empty()) throw;
      problem = problem.empty() ? error.what() : problem;
    }
    if (!found.empty() && (identity_.empty() || found == identity_)) {
      path_ = path;
      identity_ = found;
      return;
    }
    if (path == settings_.path && !found.empty()) {
      problem = text_of("another camera is at ", path, ": ", found, ", not ", identity_);
    }
    system_.close(std::exchange(file_, -1));
  }
  throw Error(problem);
}

std::string VideoDevice::look_at(const std::string& path) {
  v4l2_capability capability{};
  if (call(VIDIOC_QUERYCAP, &capability) != 0) {
    throw SystemError("ask " + path + " what it can do", errno);
  }
  const std::uint32_t can = capabilities_of(capability);
  detail::require((can & V4L2_CAP_VIDEO_CAPTURE) != 0 && (can & V4L2_CAP_STREAMING) != 0,
                  path + " is no camera; 'trifinger cameras --list' shows cameras");
  const std::string serial = system_.serial_of(path);
  return text(capability.card) + " at " + text(capability.bus_info) +
         (serial.empty() ? "" : " with serial number " + serial);
}

void VideoDevice::close() noexcept {
  if (file_ < 0) return;
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  static_cast<void>(call(VIDIOC_STREAMOFF, &type));
  for (const Buffer& buffer : buffers_) system_.unmap(buffer.memory, buffer.size);
  buffers_.clear();
  system_.close(file_);
  file_ = -1;
}

void VideoDevice::lose(const std::string& why) {
  report("the camera at " + settings_.path + " is lost: " + why);
  close();
  next_try_ = std::chrono::steady_clock::now() + kVideoRetry;
}

void VideoDevice::choose_format() {
  std::string offered;
  for (const std::uint32_t wanted : formats_for(settings_.format.pixels)) {
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    format.fmt.pix.width = static_cast<std::uint32_t>(settings_.format.width);
    format.fmt.pix.height = static_cast<std::uint32_t>(settings_.format.height);
    format.fmt.pix.pixelformat = wanted;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    if (call(VIDIOC_S_FMT, &format) != 0) {
      if (errno == EINVAL) continue;
      throw SystemError("set the format of " + settings_.path, errno);
    }
    const v4l2_pix_format& found = format.fmt.pix;
    if (found.pixelformat != wanted) continue;
    width_ = static_cast<int>(found.width);
    height_ = static_cast<int>(found.height);
    fourcc_ = found.pixelformat;
    stride_ = std::max<std::size_t>(found.bytesperline, bytes_per_pixel(fourcc_) * found.width);
    if (width_ >= settings_.format.width && height_ >= settings_.format.height) return;
    offered += text_of(offered.empty() ? "" : ", ", width_, " x ", height_, " in ",
                       name_of_fourcc(fourcc_));
  }
  throw InvalidArgument(text_of("the camera at ", settings_.path, " has no images of ",
                                settings_.format.width, " x ", settings_.format.height,
                                " pixels or more in a format that is known here",
                                offered.empty() ? "" : "; it has " + offered));
}

void VideoDevice::set_rate_and_exposure() {
  // Cameras that cannot do this keep their own; the figures at the end show the rate.
  v4l2_streamparm rate{};
  rate.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  rate.parm.capture.timeperframe.numerator = static_cast<std::uint32_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(settings_.period).count());
  rate.parm.capture.timeperframe.denominator = 1'000'000;
  static_cast<void>(call(VIDIOC_S_PARM, &rate));
  v4l2_control mode{.id = V4L2_CID_EXPOSURE_AUTO, .value = V4L2_EXPOSURE_MANUAL};
  static_cast<void>(call(VIDIOC_S_CTRL, &mode));
  constexpr Nanoseconds kUnit = std::chrono::microseconds(100);
  v4l2_control time{
      .id = V4L2_CID_EXPOSURE_ABSOLUTE,
      .value = static_cast<std::int32_t>(std::max<std::int64_t>(1, settings_.exposure / kUnit))};
  static_cast<void>(call(VIDIOC_S_CTRL, &time));
}

void VideoDevice::start() {
  v4l2_requestbuffers request{};
  request.count = kVideoBuffers;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (call(VIDIOC_REQBUFS, &request) != 0) {
    throw SystemError("get buffers of " + settings_.path, errno);
  }
  for (std::uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = i;
    if (call(VIDIOC_QUERYBUF, &buffer) != 0) {
      throw SystemError("get buffers of " + settings_.path, errno);
    }
    std::byte* const memory = system_.map(file_, buffer.length, buffer.m.offset);
    if (memory == nullptr) throw SystemError("map buffers of " + settings_.path, errno);
    buffers_.push_back({memory, buffer.length});
    if (call(VIDIOC_QBUF, &buffer) != 0) {
      throw SystemError("hand buffers to " + settings_.path, errno);
    }
  }
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (call(VIDIOC_STREAMON, &type) != 0) throw SystemError("start " + settings_.path, errno);
  first_number_.reset();
  last_image_ = std::chrono::steady_clock::now();
}

bool VideoDevice::grab(std::span<std::byte> pixels, Frame& frame, Timeout timeout) {
  const Deadline deadline(timeout);
  if (file_ < 0) {
    const Instant now = std::chrono::steady_clock::now();
    if (now < next_try_) {
      std::this_thread::sleep_for(deadline.remaining(next_try_ - now));
      return false;
    }
    next_try_ = now + kVideoRetry;
    try {
      open();
    } catch (const Error& error) {
      // Whatever it is: the other cameras go on, and this one may be mended.
      report(error.what());
      return false;
    }
  }
  if (!system_.wait(file_, deadline.remaining(kVideoSilence))) {
    const Nanoseconds silence = std::chrono::steady_clock::now() - last_image_;
    if (silence > std::max<Nanoseconds>(kVideoSilence, 10 * settings_.period)) {
      lose("it delivers nothing any more");
    }
    return false;
  }
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  if (call(VIDIOC_DQBUF, &buffer) != 0) {
    if (errno != EAGAIN) lose(std::strerror(errno));
    return false;
  }
  last_image_ = std::chrono::steady_clock::now();
  frame = frame_of(buffer, last_image_);
  if (throttle_.end()) {
    messages_.push_back("the camera at " + settings_.path + " is back" +
                        (path_ == settings_.path ? "" : ", at " + path_));
  }
  const std::int64_t sequence = buffer.sequence;
  if (!first_number_) first_number_ = sequence - count_;
  frame.number = sequence - *first_number_;
  count_ = frame.number + 1;
  const bool is_whole = (buffer.flags & V4L2_BUF_FLAG_ERROR) == 0 &&
                        buffer.index < buffers_.size() &&
                        buffer.bytesused <= buffers_[buffer.index].size &&
                        convert({buffers_[buffer.index].memory, buffer.bytesused}, pixels);
  if (!is_whole) frame.state = Frame::State::kDamaged;
  if (call(VIDIOC_QBUF, &buffer) != 0) lose(std::strerror(errno));
  return true;
}

Frame VideoDevice::frame_of(const v4l2_buffer& buffer, Instant arrival) const {
  Frame frame{.state = Frame::State::kGood, .time = arrival, .exposure = settings_.exposure};
  if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) {
    return frame;
  }
  const Instant stamp(std::chrono::seconds(buffer.timestamp.tv_sec) +
                      std::chrono::microseconds(buffer.timestamp.tv_usec));
  const bool is_start =
      (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  // Without it the stamp is that of the last pixel, of whose way nothing is known.
  frame.time = is_start ? stamp + settings_.exposure / 2 : stamp - settings_.exposure / 2;
  frame.time = std::min(frame.time, arrival);
  return frame;
}

bool VideoDevice::convert(std::span<const std::byte> image, std::span<std::byte> pixels) {
  const ImageFormat& target = settings_.format;
  const auto width = static_cast<std::size_t>(target.width);
  const auto height = static_cast<std::size_t>(target.height);
  // The middle; even, so that colours of a mosaic stay in their places.
  auto left = static_cast<std::size_t>(width_ - target.width) / 2 / 2 * 2;
  auto top = static_cast<std::size_t>(height_ - target.height) / 2 / 2 * 2;
  if (fourcc_ == V4L2_PIX_FMT_MJPEG) {
    try {
      const Picture picture =
          decode_image({reinterpret_cast<const char*>(image.data()), image.size()});
      if (picture.format.width != width_ || picture.format.height != height_) return false;
      rgb_.resize(3 * width * height);
      const std::size_t step = channels(picture.format.pixels);
      for (std::size_t y = 0; y < height; ++y) {
        for (std::size_t x = 0; x < width; ++x) {
          const std::byte* const from =
              &picture.pixels[step * ((top + y) * static_cast<std::size_t>(width_) + left + x)];
          std::byte* const to = &rgb_[3 * (y * width + x)];
          for (std::size_t c = 0; c < 3; ++c) to[c] = from[step == 3 ? c : 0];
        }
      }
    } catch (const InvalidArgument&) {
      return false;
    }
    from_rgb(rgb_, target, pixels);
    return true;
  }
  if (image.size() < stride_ * static_cast<std::size_t>(height_)) return false;
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(image.data());
  const auto row = [&](std::size_t y) { return bytes + (top + y) * stride_; };
  const bool is_grey = fourcc_ == V4L2_PIX_FMT_GREY;
  const bool is_mosaic = fourcc_ == V4L2_PIX_FMT_SRGGB8 || fourcc_ == V4L2_PIX_FMT_SBGGR8;
  if (is_grey || is_mosaic) {
    // B G / G R is R G / G B from the pixel at (1, 1) on. At the far border a row and a column are
    // taken from two before.
    const std::size_t shift = fourcc_ == V4L2_PIX_FMT_SBGGR8 ? 1 : 0;
    const auto shifted = [shift](std::size_t i, std::size_t begin, int size) {
      const std::size_t place = i + shift;
      return begin + place < static_cast<std::size_t>(size) ? place : place - 2;
    };
    const bool is_same = is_grey || target.pixels == PixelFormat::kBayerRg8;
    const ImageFormat mosaic{
        .width = target.width, .height = target.height, .pixels = PixelFormat::kBayerRg8};
    std::vector<std::byte> between(is_same ? 0 : mosaic.size());
    std::byte* const to = is_same ? pixels.data() : between.data();
    for (std::size_t y = 0; y < height; ++y) {
      const std::uint8_t* const from = row(shifted(y, top, height_)) + left;
      for (std::size_t x = 0; x < width; ++x) {
        to[y * width + x] = static_cast<std::byte>(from[shifted(x, left, width_)]);
      }
    }
    if (!is_same) to_rgb(mosaic, between, pixels);
    return true;
  }
  rgb_.resize(3 * width * height);
  auto* const rgb = reinterpret_cast<std::uint8_t*>(rgb_.data());
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      std::uint8_t* const to = rgb + 3 * (y * width + x);
      if (fourcc_ == V4L2_PIX_FMT_YUYV) {
        const std::uint8_t* const pair = row(y) + 4 * ((left + x) / 2);
        const int light = pair[(left + x) % 2 == 0 ? 0 : 2];
        if (target.pixels == PixelFormat::kMono8) {
          // Brightness needs no colours.
          to[0] = to[1] = to[2] = clipped((298 * (light - 16) + 128) / 256);
        } else {
          write_rgb(light, pair[1], pair[3], to);
        }
      } else {
        const std::uint8_t* const from = row(y) + 3 * (left + x);
        const bool is_bgr = fourcc_ == V4L2_PIX_FMT_BGR24;
        for (std::size_t c = 0; c < 3; ++c) to[c] = from[is_bgr ? 2 - c : c];
      }
    }
  }
  from_rgb(rgb_, target, pixels);
  return true;
}

std::vector<DeviceInfo> list_video_devices(VideoSystem& system) {
  std::vector<DeviceInfo> devices;
  for (const std::string& path : video_paths()) {
    const int file = system.open(path);
    if (file < 0) continue;
    v4l2_capability found{};
    const bool is_known = system.ioctl(file, VIDIOC_QUERYCAP, &found) == 0;
    if (is_known && (capabilities_of(found) & V4L2_CAP_VIDEO_CAPTURE) != 0) {
      std::string formats;
      for (std::uint32_t k = 0;; ++k) {
        v4l2_fmtdesc format{};
        format.index = k;
        format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
        if (system.ioctl(file, VIDIOC_ENUM_FMT, &format) != 0) break;
        formats += (formats.empty() ? "" : " ") + name_of_fourcc(format.pixelformat);
      }
      devices.push_back({.kind = "v4l2",
                         .id = path,
                         .name = text(found.card),
                         .detail = text(found.bus_info) + " " + formats});
    }
    system.close(file);
  }
  return devices;
}

}  // namespace trifinger::camera
