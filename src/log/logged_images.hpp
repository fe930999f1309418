// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/log/log.hpp"

namespace trifinger::log {

/// An image as it is in a log.
struct RecordedImage {
  /// "jpeg", or how the pixels are stored: "mono8", "bayer_rggb8", "rgb8".
  std::string encoding;
  std::string bytes;
};

/// One image of each camera, of one time, in a log.
class LoggedImages {
 public:
  /// Number of the element of the companion "cameras" that they belong to.
  [[nodiscard]] TimeIndex index() const noexcept { return index_; }
  [[nodiscard]] const Stamp& stamp() const noexcept { return stamp_; }
  [[nodiscard]] const std::vector<camera::Camera>& cameras() const noexcept { return *cameras_; }
  /// One per camera, in their order.
  [[nodiscard]] const std::vector<camera::ImageInfo>& infos() const noexcept { return infos_; }
  /// The middle of the exposure of each camera's image, since 1970 [ns].
  [[nodiscard]] const std::vector<std::int64_t>& times() const noexcept { return times_; }

  /// True if the log has the image of this camera.
  [[nodiscard]] bool has(std::size_t camera) const;
  /// Size of the image of this camera in the log [bytes]; 0 if the log does not have it.
  [[nodiscard]] std::size_t size(std::size_t camera) const;
  /// The image of a camera as it was recorded.
  /// @throws camera::CameraLost if the camera had no good image, NotInLog if it was not recorded
  [[nodiscard]] RecordedImage recorded(std::size_t camera) const;
  /// The pixels of a camera in the format of `cameras()`. They are those of the camera, bit for
  /// bit, if they were recorded raw.
  /// @throws camera::CameraLost and NotInLog as above, InvalidArgument for a damaged image, Error
  /// if the library for JPEG is missing
  [[nodiscard]] std::vector<std::byte> pixels(std::size_t camera) const;
  /// The image in RGB, three bytes per pixel. Throws like `pixels`.
  [[nodiscard]] std::vector<std::byte> rgb(std::size_t camera) const;

 private:
  friend class LoggedCameras;
  LoggedImages() = default;

  std::shared_ptr<detail::LogData> log_;
  std::shared_ptr<const std::vector<camera::Camera>> cameras_;
  std::string robot_;
  TimeIndex index_{0};
  Stamp stamp_{};
  std::vector<camera::ImageInfo> infos_;
  std::vector<std::int64_t> times_;
};

/// What the cameras of a robot saw, from a log: `CameraReader` for logs.
class LoggedCameras {
 public:
  /// @throws InvalidArgument if the log has no cameras of this robot
  explicit LoggedCameras(const LoggedSession& robot);

  /// The cameras as they were calibrated, in the order of the images.
  [[nodiscard]] const camera::Calibration& calibration() const noexcept { return calibration_; }
  /// The companion with what is known of each image.
  [[nodiscard]] const LoggedSession& companion() const noexcept { return companion_; }
  /// The first element in the log, and the one after the last.
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range() const;

  /// The images of element `index` of the companion. @throws NotInLog, SystemError
  [[nodiscard]] LoggedImages at(TimeIndex index) const;
  /// The newest images that had arrived at the robot's step `t`. Nothing if none had.
  /// @throws NotInLog, SystemError
  [[nodiscard]] std::optional<LoggedImages> get_latest_at(TimeIndex t) const;
  /// The images of the first element that arrived at or after `time`, since 1970 [ns]. Nothing if
  /// there are none. @throws NotInLog, SystemError
  [[nodiscard]] std::optional<LoggedImages> find(std::int64_t time) const;

 private:
  [[nodiscard]] LoggedImages images_of(TimeIndex index, const std::byte* element) const;

  LoggedSession companion_;
  camera::Calibration calibration_;
  std::shared_ptr<const std::vector<camera::Camera>> cameras_;
};

}  // namespace trifinger::log
