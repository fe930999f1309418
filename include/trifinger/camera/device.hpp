// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/camera/source.hpp"

namespace trifinger::camera {

/// One camera that delivers images at its own pace. One thread uses it.
class Device {
 public:
  Device() = default;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  virtual ~Device() = default;

  /// Waits for the next image and writes it to `pixels`. False if none has come within `timeout`,
  /// also if the camera is not there: see `is_there`. Looks for a camera that is not there.
  [[nodiscard]] virtual bool grab(std::span<std::byte> pixels, Frame& frame, Timeout timeout) = 0;
  [[nodiscard]] virtual bool is_there() const noexcept = 0;
  /// What has happened since the last call, in sentences.
  [[nodiscard]] virtual std::vector<std::string> take_news() = 0;
};

/// Makes one source of single cameras. Images belong together if their times differ by half a
/// period at most. An image that has no partner is delivered alone; a camera that is slow is not
/// waited for longer than two periods. A thread for each camera takes its images.
class CameraGroup final : public Source {
 public:
  /// `devices` are in the order of `cameras`.
  /// @throws InvalidArgument
  CameraGroup(const std::vector<Camera>& cameras, std::vector<std::unique_ptr<Device>> devices,
              Nanoseconds period);
  ~CameraGroup() override;

  [[nodiscard]] const std::vector<std::string>& names() const noexcept override;
  [[nodiscard]] const std::vector<ImageFormat>& formats() const noexcept override;
  [[nodiscard]] bool grab(std::span<const std::span<std::byte>> images, std::span<Frame> frames,
                          Timeout timeout) override;
  [[nodiscard]] std::vector<std::string> take_news() override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Finds the host's time of events that a device has marked with a clock of its own.
///
/// An image arrives some time after it was marked, never before. So the smallest difference of the
/// two clocks in the last seconds is that of the clocks and the shortest way.
class DeviceClock {
 public:
  /// The host's time of an event at `device_time` that arrived at `arrival`; never later than that.
  [[nodiscard]] Instant host_time(Nanoseconds device_time, Instant arrival) noexcept;

 private:
  static constexpr Nanoseconds kWindow = std::chrono::seconds(10);

  Nanoseconds smallest_{Nanoseconds::max()};  // of this window
  Nanoseconds before_{Nanoseconds::max()};    // of the one before
  Instant begin_{};
};

}  // namespace trifinger::camera
