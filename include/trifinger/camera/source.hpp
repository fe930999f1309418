// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/camera/camera.hpp"

namespace trifinger::camera {

/// What is known about one image.
struct Frame {
  enum class State : std::uint32_t {
    kNone,     ///< No image has come: the camera is late or has lost it.
    kGood,     ///< The image is whole.
    kDamaged,  ///< An image has come, but parts are missing. Its pixels must not be used.
    kLost,     ///< The camera is not there: unplugged, or without power.
  };

  State state{State::kNone};
  std::int64_t number{-1};  ///< Counted by the camera from 0. A gap means that images were lost.
  Instant time{};           ///< Middle of the exposure, on the monotonic clock.
  Nanoseconds exposure{0};  ///< Length of the exposure.
};
[[nodiscard]] std::string_view name_of(Frame::State state) noexcept;

/// The cameras of a robot, or what stands for them: they deliver images together, one of each.
///
/// Every source passes one contract (tests/camera/source_contract.cpp).
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;

  /// Names of the cameras, in the order of the images.
  [[nodiscard]] virtual const std::vector<std::string>& names() const noexcept = 0;
  /// Formats of their images. Neither names nor formats ever change.
  [[nodiscard]] virtual const std::vector<ImageFormat>& formats() const noexcept = 0;

  /// Waits for the next images and writes them to `images`, one span of `format.size()` bytes per
  /// camera, and what is known about each to `frames`. The pixels of an image whose state is not
  /// `kGood` are undefined. The times of those that are good rise for each camera, and their mean
  /// does not go back. False if none has come within `timeout` or if there will be no more: see
  /// `has_ended`; `frames` then say which cameras are `kLost`, and nothing else. A camera that is
  /// unplugged makes its images `kLost`, not this an error.
  /// @throws Error if the source is broken for good
  [[nodiscard]] virtual bool grab(std::span<const std::span<std::byte>> images,
                                  std::span<Frame> frames, Timeout timeout) = 0;
  /// True if no more images will come: at the end of a log or a folder.
  [[nodiscard]] virtual bool has_ended() const noexcept { return false; }

  /// What has happened to the cameras since the last call, in sentences: "camera60 is unplugged".
  [[nodiscard]] virtual std::vector<std::string> take_messages() { return {}; }
};

}  // namespace trifinger::camera
