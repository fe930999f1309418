// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/device.hpp"
#include "camera/error_throttle.hpp"
#include "claims.hpp"
#include "trifinger/camera/options.hpp"

namespace trifinger::camera {

struct AravisSettings {
  // A serial number or the name that Aravis gives; "any" for the first one that is nobody's. The
  // first one that is opened is meant from then on.
  std::string device;
  std::shared_ptr<Claims> claims{std::make_shared<Claims>()};
  ImageFormat format{};
  // Where images begin on the sensor [pixel]. Default: where they do when it is first opened.
  std::optional<std::array<int, 2>> offset{};
  Nanoseconds period{0};
  Nanoseconds exposure{0};
  double gain{0};  // [dB]
};

// A GenICam camera at USB or Ethernet. One that is not there, or from which nothing comes for a
// second, is looked for until it is back.
class AravisDevice final : public Device {
 public:
  // Throws InvalidArgument for a camera that cannot deliver such images, Error if Aravis is
  // missing.
  explicit AravisDevice(AravisSettings settings);
  ~AravisDevice() override;

  [[nodiscard]] bool grab(std::span<std::byte> pixels, Frame& frame, Timeout timeout) override;
  [[nodiscard]] bool is_there() const noexcept override { return is_there_; }
  [[nodiscard]] std::vector<std::string> take_messages() override;

 private:
  // Throws Error if there is no such camera, InvalidArgument if it has no such images.
  void open();
  void connect(const std::string& name);
  void close() noexcept;
  void configure();
  // Returns where images begin.
  [[nodiscard]] std::array<int, 2> set_region();
  void start();
  void report(const std::string& error);
  [[nodiscard]] std::int64_t number_of(std::uint64_t id) noexcept;
  [[nodiscard]] Instant time_of(Nanoseconds stamp, Instant arrival, bool is_whole,
                                std::int64_t steps) noexcept;

  AravisSettings settings_;
  void* camera_{nullptr};
  void* stream_{nullptr};
  bool is_there_{false};
  bool is_loopback_{false};
  bool is_gv_{false};
  std::string name_;
  ErrorThrottle throttle_;
  Instant next_try_{};
  Instant last_image_{};
  DeviceClock clock_;
  Nanoseconds last_stamp_{0};
  Instant last_time_{Instant::min()};
  std::uint64_t last_id_{0};
  std::int64_t number_{-1};
  bool is_counting_{false};
  std::vector<std::string> messages_;
};

// The cameras that Aravis finds. Throws Error if it is missing.
[[nodiscard]] std::vector<DeviceInfo> list_aravis_devices();

}  // namespace trifinger::camera
