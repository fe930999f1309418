// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "trifinger/camera/device.hpp"
#include "trifinger/camera/options.hpp"

namespace trifinger::camera {

struct AravisSettings {
  std::string device;  // a serial number or the name that Aravis gives; "any" for the `index`th
  std::size_t index{0};
  ImageFormat format{};
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
  [[nodiscard]] std::vector<std::string> take_news() override;

 private:
  // Sets the trouble and returns false if there is no such camera.
  bool open();
  void close() noexcept;
  void configure();
  void start();
  [[nodiscard]] std::int64_t number_of(std::uint64_t id) noexcept;

  AravisSettings settings_;
  void* camera_{nullptr};
  void* stream_{nullptr};
  bool is_there_{false};
  bool is_loopback_{false};
  bool is_gv_{false};
  std::string name_;
  std::string trouble_;
  Instant next_try_{};
  Instant last_image_{};
  DeviceClock clock_;
  std::uint64_t last_id_{0};
  std::int64_t number_{-1};
  bool is_counting_{false};
  std::vector<std::string> news_;
};

// The cameras that Aravis finds. Throws Error if it is missing.
[[nodiscard]] std::vector<DeviceInfo> list_aravis_devices();

}  // namespace trifinger::camera
