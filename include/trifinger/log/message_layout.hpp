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

/// How the float64 of elements are stored.
enum class Precision : std::uint8_t {
  kDouble,  ///< As they are.
  kSingle,  ///< As float32: half the bytes, and no exact replay.
};

/// "double" or "single".
[[nodiscard]] constexpr std::string_view name_of(Precision precision) noexcept {
  return precision == Precision::kSingle ? "single" : "double";
}

/// One part of a message: an element of a series, or a few fields of the message's own.
struct MessagePart {
  std::string name;  ///< The field of the message that holds the element; empty: its fields are
                     ///< those of the message.
  std::string type;  ///< Of that field, as in "TrifingerObservation"; not used without a name.
  ElementDescription element;
};

/// A ROS 2 message made of elements: its definition, and how the elements' bytes become CDR.
///
/// Elements are laid out as C++ does, which is how CDR does it too as long as nothing needs
/// padding; then encoding is a copy per part.
class MessageLayout {
 public:
  /// `type` is the message's name without its package, as in "TrifingerStep".
  /// @throws InvalidArgument for names that ROS 2 does not allow
  MessageLayout(std::string_view type, const std::vector<MessagePart>& parts,
                Precision precision = Precision::kDouble);

  /// As in "trifinger_msgs/msg/TrifingerStep".
  [[nodiscard]] const std::string& type() const noexcept { return type_; }
  /// The text of the schema ("ros2msg"), with the types that it uses.
  [[nodiscard]] const std::string& definition() const noexcept { return definition_; }
  /// Bytes of a message, the four of the CDR header included.
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::size_t num_parts() const noexcept { return parts_.size(); }

  /// Writes the CDR message of `elements`, one address per part, to `message` of `size()` bytes.
  void encode(std::span<const void* const> elements, std::byte* message) const noexcept;
  /// Writes element `part` of a message of `size()` bytes; single precision becomes double again.
  void decode(std::span<const std::byte> message, std::size_t part, void* element) const noexcept;

 private:
  // A piece of an element that is copied, or converted, as one.
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

/// What every message begins with. The second field is called "time_index" in the messages of
/// robots and "index" in those of companions.
struct MessageHead {
  std::uint64_t session_id{0};  ///< Of the robot's session.
  TimeIndex index{0};
};

/// The parts of the messages of a log, in their order; docs/log_format.md.
enum StepPart : std::uint8_t { kHead, kStatus, kObservation, kAppliedAction, kDesiredAction };
/// The message of a whole step: all parts.
[[nodiscard]] MessageLayout step_layout(const RobotTypes& robot, const ElementDescription& status,
                                        Precision precision);
/// The message of a session's end: head, status and observation.
[[nodiscard]] MessageLayout end_layout(const RobotTypes& robot, const ElementDescription& status,
                                       Precision precision);
/// The message of an element of a companion of this type: head and element.
[[nodiscard]] MessageLayout companion_layout(std::string_view type,
                                             const ElementDescription& element,
                                             Precision precision);

}  // namespace trifinger::log
