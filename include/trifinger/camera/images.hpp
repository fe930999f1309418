// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/camera/source.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/payload.hpp"
#include "trifinger/core/sensor.hpp"

namespace trifinger::camera {

/// Name of the companion with the images of a robot.
inline constexpr const char* kCompanion = "cameras";
/// Name of the document of a session that has the calibration of its cameras.
inline constexpr const char* kDocument = "cameras.yml";

/// What an element of the companion says about one image.
struct ImageInfo {
  std::int64_t number{-1};   ///< Counted by the camera from 0; -1 before its first image.
  std::int64_t time{0};      ///< Middle of the exposure, on the monotonic clock [ns].
  std::int64_t exposure{0};  ///< [ns]
  /// Images of this camera that did not arrive, or not as a whole, since its process was started.
  std::uint32_t missed{0};
  std::uint32_t state{0};  ///< Frame::State

  static constexpr auto fields() {
    return std::tuple{field("number", &ImageInfo::number), field("time", &ImageInfo::time, "ns"),
                      field("exposure", &ImageInfo::exposure, "ns"),
                      field("missed", &ImageInfo::missed), field("state", &ImageInfo::state)};
  }

  [[nodiscard]] Frame frame() const noexcept;
};

/// An element of the companion of N cameras, as it lies in memory. In the session the fields of
/// each camera have its name, as in "camera60.number", so `image_elements` describes it.
template <std::size_t N>
struct CameraImages {
  Stamp stamp{};
  PayloadReference payload{};
  std::array<ImageInfo, N> images{};
};

/// The fields of the elements: a stamp, where the pixels lie, and an ImageInfo per camera.
/// @throws InvalidArgument if the names of the cameras cannot be those of fields
[[nodiscard]] ElementDescription image_elements(const std::vector<Camera>& cameras);
/// The fields of the payload: the pixels of each camera under its name, uint8[height, width] or
/// uint8[height, width, 3].
[[nodiscard]] ElementDescription image_payload(const std::vector<Camera>& cameras);
/// The companion of a robot with these cameras, for its driver.
[[nodiscard]] CompanionDescription camera_companion(const std::vector<Camera>& cameras);

/// There is no good image of a camera.
class CameraLost : public Error {
 public:
  CameraLost(std::string camera, Frame::State state);

  [[nodiscard]] const std::string& camera() const noexcept { return camera_; }
  [[nodiscard]] Frame::State state() const noexcept { return state_; }

 private:
  std::string camera_;
  Frame::State state_;
};

/// One image of each camera, read in place. Check `is_valid()` after using the pixels.
class Images {
 public:
  /// @param element an element of the companion of `cameras`, `view` its payload, if there is one
  Images(std::shared_ptr<const std::vector<Camera>> cameras, std::span<const std::byte> element,
         std::optional<PayloadView> view);

  [[nodiscard]] const Stamp& stamp() const noexcept { return stamp_; }
  [[nodiscard]] const std::vector<Camera>& cameras() const noexcept { return *cameras_; }
  /// One per camera, in their order.
  [[nodiscard]] const std::vector<ImageInfo>& infos() const noexcept { return infos_; }

  /// The pixels of a camera, row by row, in the format of `cameras()`.
  /// @throws CameraLost if there is no good image of this camera, HistoryLost if it has been
  /// overwritten, InvalidArgument that names the cameras
  [[nodiscard]] std::span<const std::byte> pixels(std::size_t camera) const;
  [[nodiscard]] std::span<const std::byte> pixels(const std::string& camera) const;

  /// False if the pixels have been overwritten or their memory is gone: what was read before may be
  /// wrong. True if there is no good image and so nothing to read.
  [[nodiscard]] bool is_valid() const noexcept;
  /// @throws HistoryLost unless `is_valid()`
  void require_valid() const;

 private:
  std::shared_ptr<const std::vector<Camera>> cameras_;
  Stamp stamp_{};
  std::vector<ImageInfo> infos_;
  std::optional<PayloadView> view_;
};

/// The calibration of the cameras of a session's robot.
/// @throws InvalidArgument if it has no cameras, config::ConfigError
[[nodiscard]] Calibration calibration_of(const Session& session);

/// What the cameras of a robot see.
class CameraReader {
 public:
  template <Robot R>
  explicit CameraReader(const Frontend<R>& robot)
      : CameraReader(robot.session(), robot.companion(kCompanion)) {}
  /// `companion` is that of the cameras of `robot`.
  /// @throws InvalidArgument if the robot has no cameras, IncompatibleSession
  CameraReader(const Session& robot, UntypedFrontend companion);

  /// The cameras as they were calibrated, in the order of the images.
  [[nodiscard]] const Calibration& calibration() const noexcept { return calibration_; }
  /// The newest images that had arrived at the robot's step `t`; waits for that step. Nothing if
  /// none had. Their pixels can be read for some 16 further images.
  [[nodiscard]] std::optional<Images> get_latest_at(TimeIndex t, Timeout timeout = kForever) const;
  /// The newest images, also before step 0 and after the end. Nothing if none has arrived.
  [[nodiscard]] std::optional<Images> latest() const;

 private:
  [[nodiscard]] Images images_of(std::span<const std::byte> element) const;

  UntypedFrontend companion_;
  Calibration calibration_;
  std::shared_ptr<const std::vector<Camera>> cameras_;
};

/// What the process of a robot's cameras sees, also while the robot holds its pose or does not run:
/// for trackers and calibrations. Nobody promises that an answer can be repeated.
class LiveCameras {
 public:
  /// @throws InvalidArgument
  LiveCameras(const std::string& robot, const std::vector<Camera>& cameras);

  /// The newest images, if they are others than at the last call; waits for them up to `timeout`.
  /// Nothing if none have come.
  /// @throws InvalidArgument if the process has other cameras, SystemError
  [[nodiscard]] std::optional<Images> next(Timeout timeout);

 private:
  UntypedSensorReader sensor_;
  PayloadReader payloads_;
  std::shared_ptr<const std::vector<Camera>> cameras_;
};

/// Writes images into memory that readers share: begin, fill in the pixels, commit.
class ImageWriter {
 public:
  /// Writes the images of `robot`, in the process of its cameras.
  /// @throws InvalidArgument, SystemError, Error if another process writes them already
  ImageWriter(const std::string& robot, const std::vector<Camera>& cameras,
              std::size_t history = PayloadWriter::kDefaultHistory);
  /// For readers in this process only.
  [[nodiscard]] static ImageWriter anonymous(const std::vector<Camera>& cameras,
                                             std::size_t history = PayloadWriter::kDefaultHistory);

  /// The place for the pixels of each camera. Valid until `commit`.
  [[nodiscard]] std::span<const std::span<std::byte>> begin() noexcept;
  /// Makes the images readable and fills in their element, except for its stamp. If no image is
  /// good, the element has no payload and the next images get the same place.
  void commit(std::span<const Frame> frames, std::span<std::byte> element) noexcept;

  /// Size of an element [bytes].
  [[nodiscard]] std::size_t element_size() const noexcept;

 private:
  ImageWriter(PayloadWriter payloads, const std::vector<Camera>& cameras);

  PayloadWriter payloads_;
  std::vector<std::size_t> sizes_;
  std::vector<std::span<std::byte>> places_;
  std::vector<ImageInfo> last_;
};

/// The cameras of a robot in a process of their own: writes images and tells the robot of them.
class CameraSensor {
 public:
  /// @throws InvalidArgument, SystemError, Error if another process is the cameras of the robot
  CameraSensor(const std::string& robot, const std::vector<Camera>& cameras,
               std::size_t history = PayloadWriter::kDefaultHistory);

  /// The place for the pixels of each camera. Valid until `write`.
  [[nodiscard]] std::span<const std::span<std::byte>> begin() noexcept { return images_.begin(); }
  /// Hands the images over. They count as captured in the middle of the good ones' exposures. If
  /// there are none, the time is that of the last ones that were good: it never goes back.
  void write(std::span<const Frame> frames) noexcept;

 private:
  ImageWriter images_;
  UntypedSensorWriter sensor_;
  std::vector<std::byte> element_;
  Instant captured_;  // of the last element
  bool has_written_{false};
};

}  // namespace trifinger::camera
