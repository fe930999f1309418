// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <linux/videodev2.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/device.hpp"
#include "camera/error_throttle.hpp"
#include "trifinger/camera/options.hpp"
#include "video_system.hpp"

namespace trifinger::camera {

struct VideoSettings {
  std::string path;  // "/dev/video0"
  ImageFormat format{};
  Nanoseconds period{0};
  Nanoseconds exposure{0};
};

// A camera of Video4Linux. It delivers the middle of its images if these are larger than wanted.
// One from which nothing comes for a second is opened again.
//
// The device that is opened first is meant from then on: its name, its port and its serial number.
// When it comes back, it may have another path, and another one its path.
class VideoDevice final : public Device {
 public:
  // Throws InvalidArgument for a device that cannot deliver such images. One that is not there is
  // looked for later.
  explicit VideoDevice(VideoSettings settings, VideoSystem& system = VideoSystem::machine());
  ~VideoDevice() override;

  [[nodiscard]] bool grab(std::span<std::byte> pixels, Frame& frame, Timeout timeout) override;
  [[nodiscard]] bool is_there() const noexcept override { return file_ >= 0; }
  [[nodiscard]] std::vector<std::string> take_messages() override;

 private:
  struct Buffer {
    std::byte* memory;
    std::size_t size;
  };

  // Throws SystemError if there is no such device, InvalidArgument if it has no such images.
  void open();
  void find();
  // The name, port and serial number of the open device. Throws SystemError, InvalidArgument.
  [[nodiscard]] std::string look_at(const std::string& path);
  void close() noexcept;
  void report(const std::string& error);
  void lose(const std::string& why);
  // Throws InvalidArgument.
  void choose_format();
  void set_rate_and_exposure();
  void start();
  [[nodiscard]] int call(unsigned long request, void* argument);
  // False if the image is damaged.
  [[nodiscard]] bool convert(std::span<const std::byte> image, std::span<std::byte> pixels);
  [[nodiscard]] Frame frame_of(const v4l2_buffer& buffer, Instant arrival) const;

  VideoSettings settings_;
  VideoSystem& system_;
  int file_{-1};
  std::vector<Buffer> buffers_;
  std::uint32_t fourcc_{0};
  int width_{0};
  int height_{0};
  std::size_t stride_{0};
  std::optional<std::int64_t> first_number_;  // that of this connection
  std::int64_t count_{0};                     // images of earlier connections
  Instant next_try_{};
  Instant last_image_{};
  std::string path_;      // where it was found last
  std::string identity_;  // empty before the first connection
  std::vector<std::byte> rgb_;
  ErrorThrottle throttle_;
  std::vector<std::string> messages_;
};

// The cameras of Video4Linux on this machine.
[[nodiscard]] std::vector<DeviceInfo> list_video_devices(
    VideoSystem& system = VideoSystem::machine());

}  // namespace trifinger::camera
