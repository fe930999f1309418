// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "encoding.hpp"
#include "trifinger/mcap/records.hpp"

// How much memory records take that a reader keeps, so that no file can take more than allowed.
namespace trifinger::mcap {

// Approximate memory of one node of a map or list [bytes].
inline constexpr std::uint64_t kNodeSize = 128;

[[nodiscard]] inline std::uint64_t memory_of(const Entries& entries) {
  std::uint64_t size = 0;
  for (const auto& [key, value] : entries) size += key.size() + value.size() + kNodeSize;
  return size;
}

[[nodiscard]] inline std::uint64_t memory_of(const Schema& schema) {
  return schema.name.size() + schema.encoding.size() + schema.data.size() + 2 * kNodeSize;
}

[[nodiscard]] inline std::uint64_t memory_of(const Channel& channel) {
  return channel.topic.size() + channel.message_encoding.size() + memory_of(channel.metadata) +
         2 * kNodeSize;
}

[[nodiscard]] inline std::uint64_t memory_of(const Metadata& metadata) {
  return metadata.name.size() + memory_of(metadata.entries) + kNodeSize;
}

[[nodiscard]] inline std::uint64_t memory_of(const Attachment& attachment) {
  return attachment.name.size() + attachment.media_type.size() + attachment.data.size() + kNodeSize;
}

}  // namespace trifinger::mcap
