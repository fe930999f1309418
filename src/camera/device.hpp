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
  /// also if the camera is not there: see `is_there`. Looks for a camera that is not there. The
  /// times of images rise.
  /// @throws Error if the camera cannot be used now; a later call tries again
  [[nodiscard]] virtual bool grab(std::span<std::byte> pixels, Frame& frame, Timeout timeout) = 0;
  [[nodiscard]] virtual bool is_there() const noexcept = 0;
  /// What has happened since the last call, in sentences.
  [[nodiscard]] virtual std::vector<std::string> take_messages() = 0;
};

/// Makes one source of single cameras. Images belong together if their times differ by half a
/// period at most. An image that has no partner is delivered alone; a camera that is slow is not
/// waited for longer than two periods. What comes after its partners were delivered is left out, so
/// times never go back; its number is missing. A camera whose device throws is lost, alone, until
/// its device delivers again. A thread for each camera takes its images; it has the real-time
/// priority of the thread that makes the group.
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
  [[nodiscard]] std::vector<std::string> take_messages() override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Finds the host's time of events that a device has marked with a clock of its own.
///
/// An image arrives some time after it was marked, never before. So the smallest difference of the
/// two clocks is that of the clocks and the shortest way. It may grow only as fast as clocks drift
/// apart: an image that is late has the time at which it was taken, however late it is. A clock
/// that goes back was started again; one that makes all images late by more than a second, for ten
/// seconds, stood still meanwhile.
class DeviceClock {
 public:
  /// The host's time of an event at `device_time` that arrived at `arrival`; never later than that.
  /// Times rise from call to call.
  [[nodiscard]] Instant host_time(Nanoseconds device_time, Instant arrival) noexcept;

 private:
  bool is_known_{false};
  Nanoseconds difference_{0};  // the smallest, and what the clocks may have drifted since
  Nanoseconds last_device_{0};
  Instant last_arrival_{};
  Instant last_host_{Instant::min()};
  Instant late_since_{Instant::max()};  // arrival of the first of very late images
};

}  // namespace trifinger::camera
