// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "log/format/image_messages.hpp"
#include "log/format/ros_messages.hpp"
#include "log/format/viewer_messages.hpp"
#include "log/message_layout.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/log/event.hpp"
#include "trifinger/log/session_header.hpp"

namespace trifinger::log::detail {

inline constexpr std::string_view kEventTopic = "/events";
inline constexpr std::string_view kSchemaEncoding = "ros2msg";
inline constexpr std::string_view kMessageEncoding = "cdr";

// Times before 1970 count as 1970.
[[nodiscard]] inline std::uint64_t log_time(std::int64_t time) noexcept {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(time, 0));
}

// A sentence for people, as a message of the topic "/events".
[[nodiscard]] std::vector<std::byte> event_message(Level level, std::string_view source,
                                                   std::string_view text, std::int64_t time);

// Makes the messages of one session: each topic, type, time and byte that a log of it has. The log
// and what is shown live get them here, so both are equal.
class SessionMessages {
 public:
  SessionMessages(SessionHeader header, Precision precision, double viewer_rate);

  // Messages of one layout on one topic.
  struct Stream {
    std::string topic;
    MessageLayout layout;
    std::vector<std::byte> message;  // the newest one
  };
  // A message of a stream. It is valid until the stream has the next one.
  struct Message {
    std::uint64_t log_time{0};  // since 1970 [ns]
    std::uint64_t publish_time{0};
    std::span<const std::byte> data;
  };
  // A message with a type of ROS 2.
  struct Typed {
    std::string topic;
    const MessageType* type;
    std::vector<std::byte> data;
  };

  [[nodiscard]] const SessionHeader& header() const noexcept { return header_; }
  [[nodiscard]] const Stream& step_stream() const noexcept { return step_; }
  [[nodiscard]] const Stream& end_stream() const noexcept { return end_; }
  [[nodiscard]] const std::vector<Stream>& companion_streams() const noexcept {
    return companions_;
  }
  [[nodiscard]] ViewerMessages& viewer() noexcept { return viewer_; }
  [[nodiscard]] const ViewerMessages& viewer() const noexcept { return viewer_; }
  [[nodiscard]] const std::optional<SessionCameras>& cameras() const noexcept { return cameras_; }

  // `index` is the number of the step. The other arguments are its elements.
  [[nodiscard]] Message step(TimeIndex index, const void* status, const void* observation,
                             const void* applied_action, const void* desired_action);
  // `observation` is nullptr if the driver could not deliver it.
  [[nodiscard]] Message end(TimeIndex index, const void* observation, const Status& status);
  // The poses in the element are remembered for the messages of viewers.
  [[nodiscard]] Message companion(std::size_t companion, TimeIndex index, const void* element);
  // Remembers the poses in an element of which no message is wanted.
  void see(std::size_t companion, const void* element);

  // "/sim/tf" for a robot called "sim".
  [[nodiscard]] std::string topic_of(std::string_view name) const;
  [[nodiscard]] std::string image_topic(std::size_t camera) const;
  // Where the cameras are, and their lenses. Empty without cameras.
  [[nodiscard]] std::vector<Typed> camera_messages(std::int64_t time) const;

 private:
  [[nodiscard]] std::uint64_t time_of(TimeIndex index, const void* status) const noexcept;
  Message encode(Stream& stream, std::span<const void* const> elements, std::uint64_t log_time,
                 std::uint64_t publish_time);

  SessionHeader header_;
  Stream step_;
  Stream end_;
  std::vector<Stream> companions_;
  ViewerMessages viewer_;
  std::optional<SessionCameras> cameras_;
  std::vector<std::byte> no_observation_;
};

}  // namespace trifinger::log::detail
