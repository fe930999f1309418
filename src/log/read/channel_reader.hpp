// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "log/message_layout.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/mcap/records.hpp"

namespace trifinger::log::detail {

struct Stream;

/// How the messages of a channel are read.
struct ChannelReader {
  enum class Role : std::uint8_t { kOther, kEvent, kStep, kEnd, kCompanion, kImage };

  Role role{Role::kOther};
  std::string topic;
  std::string session;  // name of the robot or companion; for images: of the robot
  RobotTypes types;     // for a companion: its type and its observation
  ElementDescription status;
  std::optional<MessageLayout> layout;
  std::string camera;         // for images
  bool is_compressed{false};  // for images: JPEG
  bool has_wrong_message{false};

  // Stream of the previous message: the next message usually belongs to the same one.
  std::uint64_t session_id{0};
  Stream* stream{nullptr};

  [[nodiscard]] bool is_of_stream() const noexcept { return layout.has_value(); }
};

/// Returns how to read the messages of `channel`. If the channel is not one of ours, the result
/// says that they cannot be read. @throws InvalidArgument if the channel contradicts itself
[[nodiscard]] ChannelReader reader_of(const mcap::Channel& channel);

/// True if the parts that both channels have consist of the same fields.
[[nodiscard]] bool is_compatible(const ChannelReader& one, const ChannelReader& other);

/// Returns the robot's step at which the element in this message of a companion arrived.
[[nodiscard]] TimeIndex arrival_of(const mcap::Message& message) noexcept;

}  // namespace trifinger::log::detail
