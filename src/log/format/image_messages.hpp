// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "log/format/ros_messages.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/log/session_header.hpp"

// The messages with the images of a session's cameras, and with what viewers must know of cameras.
namespace trifinger::log::detail {

// What the metadata of a channel with images says.
inline constexpr std::string_view kImageRole = "image";
inline constexpr std::string_view kJpegImages = "jpeg";
inline constexpr std::string_view kRawImages = "raw";

// The cameras of a session, if it has a companion with their images and their calibration.
struct SessionCameras {
  std::size_t companion{0};  // number among the companions of the session
  std::vector<camera::Camera> cameras;
};
[[nodiscard]] std::optional<SessionCameras> cameras_of(const SessionHeader& header);

// Name of a camera's frame: "sim/camera60".
[[nodiscard]] std::string frame_of(const std::string& robot, const camera::Camera& camera);

// The middle of the exposure of each image, since 1970 [ns]; `element` is one of the companion. In
// the element times are on the clock of the cameras; the log's clock is that of the stamp.
[[nodiscard]] std::vector<std::int64_t> image_times(const SessionHeader& header,
                                                    std::span<const camera::ImageInfo> infos,
                                                    const Stamp& stamp);

// A time of an element's stamp since 1970 [ns].
[[nodiscard]] std::int64_t stamp_time(const SessionHeader& header, TimeIndex step,
                                      std::int64_t monotonic) noexcept;

// ---- messages of images ----

// The two have the pixels of an image and lack its time, see `set_time`.
[[nodiscard]] std::vector<std::byte> compressed_image(const std::string& frame,
                                                      std::span<const std::byte> jpeg);
[[nodiscard]] std::vector<std::byte> raw_image(const std::string& frame,
                                               const camera::ImageFormat& format,
                                               std::span<const std::byte> pixels);
void set_time(std::span<std::byte> message, std::int64_t time) noexcept;

// The pixels in a message of either kind. `encoding` is "jpeg", or the name of a pixel format.
struct ImageInMessage {
  std::string encoding;
  std::span<const std::byte> bytes;
};
// Nothing if the message is damaged, or of an encoding that is not ours.
[[nodiscard]] std::optional<ImageInMessage> image_in(bool is_compressed,
                                                     std::span<const std::byte> message);

// ---- messages about cameras ----

[[nodiscard]] std::vector<std::byte> camera_info(const std::string& frame,
                                                 const camera::Camera& camera, std::int64_t time);
// Where the cameras are, as transforms that do not change.
[[nodiscard]] std::vector<std::byte> camera_frames(const std::string& robot,
                                                   const std::vector<camera::Camera>& cameras,
                                                   std::int64_t time);

}  // namespace trifinger::log::detail
