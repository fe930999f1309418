// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "log/format/records.hpp"
#include "log/read/channel_reader.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/log/session_header.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log::detail {

struct SessionRecord;

/// The messages of one robot's session, or of one of its companions.
struct Stream {
  std::string name;  // for instance "sim" or "sim.object"
  bool is_companion{false};
  SessionRecord* session{nullptr};
  const ChannelReader* channel{nullptr};  // one of the channels with its messages; nullptr if none
  std::vector<Gap> gaps;                  // gaps that the log records
};

/// A session with its companions. Its address never changes.
struct SessionRecord {
  SessionHeader header;
  std::optional<TimeIndex> steps;
  TimeIndex observations{0};  // known once the session has ended
  Fault fault;
  std::string fault_text;
  Stream robot;
  std::deque<Stream> companions;
  std::size_t order{0};  // position among all sessions
};

/// The sessions of a log: what its records say about them and which channels have their messages.
/// A session whose record is lost is added with its first message.
class SessionTable {
 public:
  [[nodiscard]] const std::deque<SessionRecord>& sessions() const noexcept { return sessions_; }
  /// True if the sessions of each robot are known to be in the order of the file.
  [[nodiscard]] bool is_ordered() const noexcept { return is_ordered_; }
  /// Compares where the sessions of two streams stand in the file: negative if that of `one` is
  /// earlier, positive if it is later. 0 if they are one session or if nothing is known.
  [[nodiscard]] int compare(const Stream& one, const Stream& other) const;

  /// Takes over a record about a session; ignores other records.
  /// @throws InvalidArgument if an entry makes no sense
  void read(const mcap::Metadata& record);
  /// Gives the sessions that a file announces their documents. Call this after `read`.
  void find_documents(const mcap::Contents& contents);
  /// Assigns a channel to all streams of its name. Returns false if that needs a look at the
  /// messages.
  [[nodiscard]] bool bind_by_name(const ChannelReader& channel);
  /// Returns the stream of the messages that `channel` has of a session, assigned to the channel.
  /// Returns nullptr if earlier messages of this stream have other fields.
  [[nodiscard]] Stream* stream_of(const ChannelReader& channel, std::uint64_t session_id);

 private:
  void read_session(const RecordEntries& entries);
  void read_end(const RecordEntries& entries);
  void read_gap(const RecordEntries& entries);
  [[nodiscard]] SessionRecord* find_session(const std::string& name, std::uint64_t session_id);
  SessionRecord& add_session(SessionHeader header);
  [[nodiscard]] SessionRecord& session_of(const std::string& name, std::uint64_t session_id);

  std::deque<SessionRecord> sessions_;
  bool is_ordered_{true};
};

}  // namespace trifinger::log::detail
