// SPDX-License-Identifier: BSD-3-Clause
#include "log/read/channel_reader.hpp"

#include <cstring>

#include "log/format/format.hpp"
#include "log/format/image_messages.hpp"
#include "log/format/records.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::log::detail {

ChannelReader reader_of(const mcap::Channel& channel) {
  using Role = ChannelReader::Role;
  ChannelReader reader;
  reader.topic = channel.topic;
  reader.session = entry_of(channel.metadata, "session");
  if (channel.message_encoding != "cdr") return reader;
  if (channel.topic == "/events" && reader.session.empty()) reader.role = Role::kEvent;
  const std::string role = entry_of(channel.metadata, "role");
  if (role == kImageRole) {
    reader.role = Role::kImage;
    reader.session = entry_of(channel.metadata, "robot");
    reader.camera = entry_of(channel.metadata, "camera");
    reader.is_compressed = entry_of(channel.metadata, "images") == kJpegImages;
    return reader;
  }
  if (reader.session.empty() || (role != "step" && role != "end" && role != "companion")) {
    return reader;
  }

  const Precision precision =
      entry_of(channel.metadata, "precision") == "single" ? Precision::kSingle : Precision::kDouble;
  const auto element = [&channel](const std::string& key) {
    return ElementDescription::parse(entry_of(channel.metadata, key));
  };
  reader.types.type = entry_of(channel.metadata, "type");
  reader.types.observation = element("observation");
  if (role == "companion") {
    reader.role = Role::kCompanion;
    const FieldDescription* const arrival = reader.types.observation.find("stamp.arrival_index");
    if (arrival == nullptr || arrival->offset != 0 || arrival->type != ScalarType::kInt64 ||
        !arrival->shape.empty()) {
      throw InvalidArgument("its elements do not begin with a stamp");
    }
    reader.layout = companion_layout(reader.types.type, reader.types.observation, precision);
    return reader;
  }
  reader.status = element("status");
  if (role == "end") {
    reader.role = Role::kEnd;
    reader.layout = end_layout(reader.types, reader.status, precision);
    return reader;
  }
  reader.role = Role::kStep;
  reader.types.action = element("action");
  reader.types.applied_action = element("applied_action");
  reader.types.default_action = bytes_of(entry_of(channel.metadata, "default_action"));
  // Another writer may have given another size.
  reader.types.default_action.resize(reader.types.action.size());
  reader.layout = step_layout(reader.types, reader.status, precision);
  return reader;
}

bool is_compatible(const ChannelReader& one, const ChannelReader& other) {
  using Role = ChannelReader::Role;
  const bool has_end = one.role == Role::kEnd || other.role == Role::kEnd;
  return one.types.type == other.types.type && one.types.observation == other.types.observation &&
         one.status == other.status &&
         (has_end || (one.types.action == other.types.action &&
                      one.types.applied_action == other.types.applied_action));
}

TimeIndex arrival_of(const mcap::Message& message) noexcept {
  // The arrival comes after CDR's header and our own.
  constexpr std::size_t kOffset = kCdrHeaderSize + sizeof(MessageHead);
  TimeIndex arrival = 0;
  std::memcpy(&arrival, message.data.data() + kOffset, sizeof(arrival));
  return arrival;
}

}  // namespace trifinger::log::detail
