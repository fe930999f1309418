// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "trifinger/log/event.hpp"

namespace trifinger::log {

/// How much of a running robot is shown.
struct LiveOptions {
  /// Number of steps, and of elements of each companion, per second of the robot's time; 0: all.
  double rate{100.0};
  /// How often 3D viewers get the poses of a robot's links, per second of the robot's time; 0:
  /// never.
  double viewer_rate{30.0};
  int jpeg_quality{80};  ///< Quality of the images, 1 to 100.
};

/// Messages of one topic and one type.
struct LiveChannel {
  std::string topic;       ///< For example "/sim/step".
  std::string type;        ///< For example "trifinger_msgs/msg/TrifingerStep".
  std::string definition;  ///< The text of the schema ("ros2msg"), with the types that it uses.
  /// True if viewers that come later need the newest message of each `part`: it will not come
  /// again.
  bool is_latched{false};
  bool is_image{false};  ///< True if these messages only come while images are wanted.
};

/// A message in CDR, with the bytes that a log of the same session has.
struct LiveMessage {
  std::size_t channel{0};     ///< Its number in `channels()`.
  std::uint64_t log_time{0};  ///< Time since 1970 [ns], as in a log.
  int part{0};                ///< Only latched channels have more than part 0.
  std::vector<std::byte> data;
};

/// What is new since the call before.
struct LiveBatch {
  std::vector<LiveMessage> messages;  ///< In the order of each channel.
  std::vector<Event> events;          ///< The same sentences are messages of the topic "/events".
  /// Number of messages that were left out, because the reader was late or the robot too fast.
  std::int64_t lost{0};
};

/// Observes a robot for other programs: gives the messages that a log would have, as soon as they
/// can be made. It shows the current session of the robot and those that follow.
///
/// It only reads, so the robot notices nothing. If the reader is late, it continues with what is
/// newest. There is at most a second of messages in one batch.
///
/// Times of a session in real-time mode may differ from those in a log by the microseconds with
/// which each of them measured the offset of the clocks.
class LiveMessages {
 public:
  /// Begins to look for the robot `name`, which need not run yet.
  /// @throws InvalidArgument if `name` is a companion's or an option is out of range
  explicit LiveMessages(const std::string& name, const LiveOptions& options = {});
  ~LiveMessages();

  /// Returns what is new. Never waits for the robot; call it some 50 times per second.
  /// @throws InvalidArgument if no robot can have this name
  [[nodiscard]] LiveBatch take();
  /// All channels so far; more may come with each batch. If two have the same topic, the later one
  /// counts: the next session has another type.
  [[nodiscard]] const std::vector<LiveChannel>& channels() const noexcept;
  /// Says whether somebody looks at images. Only then are they copied and compressed, which takes
  /// some milliseconds of a processor per image. At the beginning nobody does.
  void want_images(bool wanted) noexcept;
  /// True if a session is shown that has not ended.
  [[nodiscard]] bool is_running() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::log
