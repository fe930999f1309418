// SPDX-License-Identifier: BSD-3-Clause
#include "log/read/session_table.hpp"

#include <algorithm>
#include <map>
#include <utility>

namespace trifinger::log::detail {

namespace {

Stream& add_companion(SessionRecord& session, const std::string& name) {
  Stream& stream = session.companions.emplace_back();
  stream.name = name;
  stream.is_companion = true;
  stream.session = &session;
  return stream;
}

Stream* find_stream(SessionRecord& session, const std::string& name) {
  if (session.robot.name == name) return &session.robot;
  for (Stream& companion : session.companions) {
    if (companion.name == name) return &companion;
  }
  return nullptr;
}

bool accepts(const Stream& stream, const ChannelReader& channel) {
  return stream.channel == nullptr || is_compatible(*stream.channel, channel);
}

void bind(Stream& stream, const ChannelReader& channel) {
  // The channel of the steps knows more than the channel of the end.
  if (stream.channel != nullptr && stream.channel->role != ChannelReader::Role::kEnd) return;
  stream.channel = &channel;
  SessionHeader& header = stream.session->header;
  if (!stream.is_companion) {
    header.types = channel.types;
    return;
  }
  const bool is_listed = std::ranges::any_of(
      header.companions, [&](const auto& companion) { return companion.name == stream.name; });
  if (is_listed) return;
  header.companions.push_back({stream.name, channel.types.type, channel.types.observation});
}

}  // namespace

int SessionTable::compare(const Stream& one, const Stream& other) const {
  const SessionRecord& a = *one.session;
  const SessionRecord& b = *other.session;
  if (!is_ordered_ || &a == &b || a.header.name != b.header.name) return 0;
  return a.order < b.order ? -1 : 1;
}

// ---- records ----

void SessionTable::read(const mcap::Metadata& record) {
  if (record.name == kSessionRecord) read_session(RecordEntries(record));
  if (record.name == kEndRecord) read_end(RecordEntries(record));
  if (record.name == kGapRecord) read_gap(RecordEntries(record));
}

void SessionTable::read_session(const RecordEntries& entries) {
  const std::string name = entries.name();
  const TimeIndex first_index = entries.integer("first_index");
  if (SessionRecord* const known = find_session(name, entries.session_id())) {
    // The session is announced again at the beginning of each further part.
    known->header.first_index = std::min(known->header.first_index, first_index);
    return;
  }
  SessionRecord& session = add_session(entries.session_header());
  for (const std::string& companion : words_of(entries.text("companions"))) {
    add_companion(session, companion);
  }
}

void SessionTable::read_end(const RecordEntries& entries) {
  SessionRecord& session = session_of(entries.name(), entries.session_id());
  session.fault = {.code = static_cast<Fault::Code>(entries.integer("fault_code")),
                   .detail = static_cast<std::int32_t>(entries.integer("fault_detail")),
                   .time_index = entries.integer("fault_time_index")};
  session.fault_text = entries.text("fault_text");
  session.observations = entries.integer("observations");
  session.steps = entries.integer("steps");
}

void SessionTable::read_gap(const RecordEntries& entries) {
  const std::string name = entries.name();
  const Gap gap{entries.integer("first"), entries.integer("last"), entries.text("reason")};
  if (gap.last < gap.first) return;
  // The name is that of a robot or of a companion.
  for (SessionRecord& session : sessions_) {
    if (session.header.session_id != entries.session_id()) continue;
    if (session.robot.name == name) session.robot.gaps.push_back(gap);
    for (Stream& companion : session.companions) {
      if (companion.name == name) companion.gaps.push_back(gap);
    }
  }
}

void SessionTable::find_documents(const mcap::Contents& contents) {
  // The documents of a session stand before its record; only changed ones are written again.
  std::map<std::string, std::size_t> newest;
  std::size_t next = 0;
  for (std::size_t i = 0; i < contents.metadata.size(); ++i) {
    const mcap::Metadata& record = contents.metadata[i];
    if (record.name != kSessionRecord) continue;
    while (next < contents.attachments.size() &&
           contents.attachment_places[next].offset < contents.metadata_places[i].offset) {
      newest[contents.attachments[next].name] = next;
      ++next;
    }
    const auto id = number_of<std::uint64_t>(entry_of(record.entries, "session_id"));
    SessionRecord* const session =
        id ? find_session(entry_of(record.entries, "name"), *id) : nullptr;
    if (session == nullptr || !session->header.documents.empty()) continue;
    const std::string prefix = session->header.name + ".";
    for (const auto& [name, index] : newest) {
      const mcap::Attachment& attachment = contents.attachments[index];
      if (!name.starts_with(prefix)) continue;
      session->header.documents.push_back(
          {name.substr(prefix.size()), attachment.media_type, attachment.data});
    }
  }
}

// ---- channels ----

bool SessionTable::bind_by_name(const ChannelReader& channel) {
  bool is_certain = true;
  bool is_known = false;
  for (SessionRecord& session : sessions_) {
    Stream* const stream = find_stream(session, channel.session);
    if (stream == nullptr) continue;
    is_known = true;
    if (accepts(*stream, channel)) {
      bind(*stream, channel);
    } else {
      is_certain = false;
    }
  }
  return is_certain && is_known;
}

Stream* SessionTable::stream_of(const ChannelReader& channel, std::uint64_t session_id) {
  const bool is_companion = channel.role == ChannelReader::Role::kCompanion;
  const std::string robot =
      is_companion ? channel.session.substr(0, channel.session.find('.')) : channel.session;
  SessionRecord& session = session_of(robot, session_id);
  Stream* stream = find_stream(session, channel.session);
  if (stream == nullptr) stream = &add_companion(session, channel.session);
  if (!accepts(*stream, channel)) return nullptr;
  bind(*stream, channel);
  return stream;
}

// ---- sessions ----

SessionRecord* SessionTable::find_session(const std::string& name, std::uint64_t session_id) {
  for (SessionRecord& session : sessions_) {
    if (session.header.session_id == session_id && session.header.name == name) return &session;
  }
  return nullptr;
}

SessionRecord& SessionTable::add_session(SessionHeader header) {
  SessionRecord& session = sessions_.emplace_back();
  session.header = std::move(header);
  session.robot.name = session.header.name;
  session.robot.session = &session;
  session.order = sessions_.size();
  return session;
}

SessionRecord& SessionTable::session_of(const std::string& name, std::uint64_t session_id) {
  if (SessionRecord* const session = find_session(name, session_id)) return *session;
  // The session's own record is lost.
  is_ordered_ = false;
  SessionHeader header;
  header.name = name;
  header.session_id = session_id;
  return add_session(std::move(header));
}

}  // namespace trifinger::log::detail
