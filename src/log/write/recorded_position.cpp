// SPDX-License-Identifier: BSD-3-Clause
#include "log/write/recorded_position.hpp"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "log/format/format.hpp"
#include "log/format/records.hpp"
#include "log/message_layout.hpp"

namespace trifinger::log::detail {

namespace {

// Finds, in one file, the position up to which a session was recorded.
class PositionSearch {
 public:
  PositionSearch(mcap::Reader& reader, std::string robot, std::uint64_t session_id)
      : reader_(reader), robot_(std::move(robot)), session_id_(session_id) {}

  std::optional<RecordedPosition> run() {
    if (!read_metadata()) return std::nullopt;
    // The newest messages are enough. Chunks before the session's record do not contain the
    // session.
    for (std::size_t i = reader_.contents().chunks.size(); i-- > 0 && !is_complete();) {
      if (reader_.contents().chunks[i].offset < begin_) break;
      if (const auto messages = reader_.read_chunk(i)) {
        for (const mcap::Message& message : *messages) look_at(message);
      }
    }
    return position_;
  }

 private:
  [[nodiscard]] bool is_ours(const mcap::Metadata& record) const {
    return entry_of(record.entries, "session_id") == std::to_string(session_id_);
  }

  static TimeIndex number(const mcap::Metadata& record, const std::string& key) {
    return number_of<TimeIndex>(entry_of(record.entries, key)).value_or(0);
  }

  bool read_metadata() {
    const mcap::Contents& contents = reader_.contents();
    bool is_known = false;
    for (std::size_t i = 0; i < contents.metadata.size(); ++i) {
      const mcap::Metadata& record = contents.metadata[i];
      if (!is_ours(record)) continue;
      const std::string name = entry_of(record.entries, "name");
      if (record.name == kSessionRecord && name == robot_) {
        is_known = true;
        begin_ = contents.metadata_places[i].offset;
        position_.time_offset = number(record, "time_offset");
        reach(name, number(record, "first_index"));
        const auto companions = words_of(entry_of(record.entries, "companions"));
        const auto first = words_of(entry_of(record.entries, "companion_first_indices"));
        for (std::size_t k = 0; k < companions.size(); ++k) {
          reach(companions[k], k < first.size() ? number_of<TimeIndex>(first[k]).value_or(0) : 0);
        }
      }
      if (record.name == kGapRecord) reach(name, number(record, "last") + 1);
      if (record.name == kEndRecord && name == robot_) position_.is_closed = true;
    }
    // Only channels that have messages need a search.
    for (const auto& [id, channel] : contents.channels) {
      const auto count = contents.channel_message_counts.find(id);
      if (count == contents.channel_message_counts.end() || count->second == 0) continue;
      const std::string role = entry_of(channel.metadata, "role");
      if ((role == "step" || role == "companion") &&
          is_session_of_robot(entry_of(channel.metadata, "session"))) {
        wanted_.push_back(id);
      }
    }
    return is_known;
  }

  [[nodiscard]] bool is_session_of_robot(const std::string& name) const {
    return name == robot_ || name.starts_with(robot_ + ".");
  }
  [[nodiscard]] bool is_complete() const noexcept { return position_.is_closed || wanted_.empty(); }

  void look_at(const mcap::Message& message) {
    const auto& channels = reader_.contents().channels;
    const auto channel = channels.find(message.channel_id);
    if (channel == channels.end()) return;
    const auto& metadata = channel->second.metadata;
    const std::string name = entry_of(metadata, "session");
    const std::string role = entry_of(metadata, "role");
    MessageHead head;
    if (!is_session_of_robot(name) || message.data.size() < kCdrHeaderSize + sizeof(head)) return;
    std::memcpy(&head, message.data.data() + kCdrHeaderSize, sizeof(head));
    if (head.session_id != session_id_) return;
    if (role == "end") {
      position_.has_end = true;
      return;
    }
    reach(name, head.index + 1);
    std::erase(wanted_, message.channel_id);
  }

  void reach(const std::string& name, TimeIndex next) {
    TimeIndex& known = name == robot_ ? position_.next_step : position_.next_elements[name];
    known = std::max(known, next);
  }

  mcap::Reader& reader_;
  std::string robot_;
  std::uint64_t session_id_;
  std::uint64_t begin_{0};
  std::vector<std::uint16_t> wanted_;  // channels without any message found so far
  RecordedPosition position_;
};

}  // namespace

std::optional<RecordedPosition> find_position(mcap::Reader& reader, const std::string& robot,
                                              std::uint64_t session_id) {
  return PositionSearch(reader, robot, session_id).run();
}

}  // namespace trifinger::log::detail
