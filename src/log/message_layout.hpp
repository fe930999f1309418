// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/robot.hpp"

namespace trifinger::log {

/// How a log stores the float64 numbers of elements.
enum class Precision : std::uint8_t {
  kDouble,  ///< Unchanged.
  kSingle,  ///< Stored as float32: half the bytes, but no exact replay.
};

/// Name of the precision, "double" or "single".
[[nodiscard]] constexpr std::string_view name_of(Precision precision) noexcept {
  return precision == Precision::kSingle ? "single" : "double";
}

/// One part of a message: an element of a series, or some fields of the message itself.
struct MessagePart {
  std::string name;  ///< Field of the message that holds the element. If empty, the element's
                     ///< fields are fields of the message.
  std::string type;  ///< Its type, such as "TrifingerObservation"; unused without a name.
  ElementDescription element;
};

/// A ROS 2 message made of elements. It knows the message's definition, and how to convert the
/// elements' bytes to CDR.
///
/// Elements have the memory layout of C++. CDR has the same layout as long as no padding is needed;
/// then encoding only copies each part.
class MessageLayout {
 public:
  /// `type` is the message's name without its package, for example "TrifingerStep".
  /// @throws InvalidArgument for names that ROS 2 does not allow
  MessageLayout(std::string_view type, const std::vector<MessagePart>& parts,
                Precision precision = Precision::kDouble);

  /// Full name of the type, for example "trifinger_msgs/msg/TrifingerStep".
  [[nodiscard]] const std::string& type() const noexcept { return type_; }
  /// The text of the schema ("ros2msg"), with the types that it uses.
  [[nodiscard]] const std::string& definition() const noexcept { return definition_; }
  /// Size of a message, including the four bytes of the CDR header [bytes].
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::size_t num_parts() const noexcept { return parts_.size(); }

  /// Writes the CDR message of `elements`, one address per part, to `message` of `size()` bytes.
  void encode(std::span<const void* const> elements, std::byte* message) const noexcept;
  /// Reads element `part` from a message of `size()` bytes. Single precision becomes double again.
  void decode(std::span<const std::byte> message, std::size_t part, void* element) const noexcept;

 private:
  // A piece of an element that is copied or converted as a whole.
  struct Run {
    std::size_t element_offset;
    std::size_t message_offset;
    std::size_t count;  // bytes, or numbers if converted
    bool converts;      // float64 <-> float32
  };

  std::string type_;
  std::string definition_;
  std::size_t size_{0};
  std::vector<std::vector<Run>> parts_;
};

/// The beginning of every message. The second field is called "time_index" in messages of robots
/// and "index" in messages of companions.
struct MessageHead {
  std::uint64_t session_id{0};  ///< Id of the robot's session.
  TimeIndex index{0};
};

/// The parts of the messages of a log, in their order; see docs/log_format.md.
enum StepPart : std::uint8_t { kHead, kStatus, kObservation, kAppliedAction, kDesiredAction };
/// The message of a whole step, with all parts.
[[nodiscard]] MessageLayout step_layout(const RobotTypes& robot, const ElementDescription& status,
                                        Precision precision);
/// The message of a session's end, with head, status and observation.
[[nodiscard]] MessageLayout end_layout(const RobotTypes& robot, const ElementDescription& status,
                                       Precision precision);
/// The message of an element of a companion of this type, with head and element.
[[nodiscard]] MessageLayout companion_layout(std::string_view type,
                                             const ElementDescription& element,
                                             Precision precision);

}  // namespace trifinger::log
