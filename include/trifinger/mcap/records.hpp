// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

// The records of an MCAP file, version 0 (https://mcap.dev/spec), as their users see them. Times
// are in nanoseconds since 1970.
namespace trifinger::mcap {

/// How chunks are compressed.
enum class Compression : std::uint8_t { kNone, kLz4, kZstd };
/// The name in a chunk's header: "", "lz4" or "zstd".
[[nodiscard]] std::string_view name_of(Compression compression) noexcept;

/// The type of the messages of a channel.
struct Schema {
  std::uint16_t id{0};     ///< Above 0.
  std::string name{};      ///< For example "sensor_msgs/msg/JointState".
  std::string encoding{};  ///< Encoding of `data`, for example "ros2msg".
  std::string data{};      ///< The definition.

  friend bool operator==(const Schema&, const Schema&) = default;
};

/// A stream of messages of one type.
struct Channel {
  std::uint16_t id{0};
  std::uint16_t schema_id{0};  ///< 0 if the messages have no schema.
  std::string topic{};
  std::string message_encoding{};  ///< For example "cdr".
  std::map<std::string, std::string> metadata{};

  friend bool operator==(const Channel&, const Channel&) = default;
};

/// One message. Does not own its bytes.
struct Message {
  std::uint16_t channel_id{0};
  std::uint32_t sequence{0};      ///< 0 if nobody counts.
  std::uint64_t log_time{0};      ///< [ns]
  std::uint64_t publish_time{0};  ///< [ns]
  std::span<const std::byte> data{};
};

/// The place of a message in its chunk.
struct MessageIndexEntry {
  std::uint64_t log_time{0};  ///< [ns]
  std::uint64_t offset{0};    ///< Offset in the uncompressed chunk [bytes].

  friend bool operator==(const MessageIndexEntry&, const MessageIndexEntry&) = default;
};

/// A file inside the file.
struct Attachment {
  std::uint64_t log_time{0};     ///< [ns]
  std::uint64_t create_time{0};  ///< [ns]
  std::string name{};
  std::string media_type{};  ///< For example "application/yaml".
  std::string data{};

  friend bool operator==(const Attachment&, const Attachment&) = default;
};

/// Facts about the file.
struct Metadata {
  std::string name{};
  std::map<std::string, std::string> entries{};

  friend bool operator==(const Metadata&, const Metadata&) = default;
};

}  // namespace trifinger::mcap
