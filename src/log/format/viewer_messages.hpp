// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "log/format/ros_messages.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/log/session_header.hpp"

namespace trifinger::log::detail {

// A kind of message for 3D viewers, on the topic "/NAME/TOPIC" of a robot.
struct ViewerTopic {
  std::string_view name;
  const MessageType* type;
};
inline constexpr std::size_t kNumViewerTopics = 4;
enum ViewerTopicIndex : std::uint8_t {
  kRobotDescription,
  kStaticFrames,
  kMovingFrames,
  kJointStates
};
[[nodiscard]] const std::array<ViewerTopic, kNumViewerTopics>& viewer_topics();

struct ViewerMessage {
  ViewerTopicIndex topic{};
  std::int64_t time{0};  // since 1970 [ns]
  std::vector<std::byte> data;
};

// Makes the messages with which 3D viewers show a session: where all links are, some times per
// second. They come from the documents "robot.urdf" and "frames.txt" and from the elements. Without
// these documents there are no messages, and lines that cannot be understood are left out.
class ViewerMessages {
 public:
  // `rate`: messages per second of the session [1/s]; 0 for none.
  ViewerMessages(const SessionHeader& header, double rate);

  [[nodiscard]] bool has_frames() const noexcept { return !still_.empty() || moves(); }
  [[nodiscard]] bool has_description() const noexcept { return !description_.empty(); }
  // Returns the mistakes found in "frames.txt", as sentences.
  [[nodiscard]] const std::vector<std::string>& mistakes() const noexcept { return mistakes_; }
  // Returns all frames that do not move. They are the same for sessions with the same documents.
  [[nodiscard]] std::vector<ViewerMessage> still(std::int64_t time) const;

  // Remembers an element of a companion that arrived at `arrival` and was captured at `capture`,
  // both since 1970 [ns].
  void see(std::size_t companion, std::int64_t arrival, std::int64_t capture,
           const std::byte* element);
  // True if step `t` is one of those that viewers get.
  [[nodiscard]] bool shows(TimeIndex t) const noexcept {
    return every_ > 0 && t % every_ == 0 &&
           (has_frames() || has_description() || !mistakes_.empty());
  }
  // Returns the messages for a step. Numbers that are not finite are left out.
  [[nodiscard]] std::vector<ViewerMessage> at(std::int64_t time, const std::byte* observation);

 private:
  struct Pose {
    std::array<double, 3> position{};
    std::array<double, 4> rotation{1, 0, 0, 0};  // w x y z
  };
  struct Frame {
    std::string parent;
    std::string child;
    Pose pose;
  };
  // A frame that turns about an axis by an angle in the robot's observation.
  struct Turning {
    Frame frame;
    std::array<double, 3> axis{};
    std::string joint;
    std::size_t offset{0};  // bytes
  };
  // A frame whose pose comes from a companion.
  struct Free {
    Frame frame;
    std::size_t companion{0};
    std::size_t position{0};  // bytes
    std::size_t orientation{0};
  };
  struct Seen {
    std::int64_t arrival;
    std::int64_t capture;
    std::vector<Pose> poses;  // poses of this companion's `Free` frames, in their order
  };
  class Message;
  class Parser;

  [[nodiscard]] bool moves() const noexcept { return !turning_.empty() || !free_.empty(); }

  std::string description_;
  std::vector<Frame> still_;
  std::vector<Turning> turning_;
  std::vector<Free> free_;
  std::vector<std::string> mistakes_;
  TimeIndex every_{0};
  std::vector<std::deque<Seen>> seen_;  // by companion: elements not shown yet
};

}  // namespace trifinger::log::detail
