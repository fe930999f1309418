// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trifinger/log/log.hpp"
#include "trifinger/log/message_layout.hpp"

namespace trifinger::log::detail {

struct SessionRecord;
struct Stream;

/// How the messages of a channel are read.
struct ChannelReader {
  enum class Role : std::uint8_t { kOther, kEvent, kStep, kEnd, kCompanion };

  Role role{Role::kOther};
  std::string topic;
  std::string session;  // name of the robot or companion
  RobotTypes types;     // for a companion: its type and its observation
  ElementDescription status;
  std::optional<MessageLayout> layout;
  bool has_wrong_message{false};

  // Stream of the previous message: the next message usually belongs to the same one.
  std::uint64_t session_id{0};
  Stream* stream{nullptr};

  [[nodiscard]] bool is_of_stream() const noexcept { return layout.has_value(); }
};

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

/// Messages of one stream in one chunk, with consecutive indices.
struct Run {
  const Stream* stream{nullptr};
  bool is_end{false};  // holds y_N and its status instead of steps
  TimeIndex first{0};
  TimeIndex last{0};
  std::int64_t last_time{0};  // log time
  TimeIndex last_arrival{0};  // for a companion: `arrival_of` the last message
};

/// A message of a stream.
struct StreamMessage {
  const Stream& stream;
  const ChannelReader& channel;
  TimeIndex index;
  const mcap::Message& message;

  [[nodiscard]] bool is_end() const noexcept { return channel.role == ChannelReader::Role::kEnd; }
  [[nodiscard]] std::int64_t time() const noexcept {
    return static_cast<std::int64_t>(message.log_time);
  }
};

/// Returns the robot's step at which the element in this message of a companion arrived.
[[nodiscard]] TimeIndex arrival_of(const mcap::Message& message) noexcept;

/// Returns the damage of a file of `size` bytes.
[[nodiscard]] std::vector<Damage> damage_of(const std::filesystem::path& file, std::uint64_t size,
                                            const mcap::Contents& contents);
/// Returns the number of damaged bytes; each byte counts once. `damage` is all damage of one file.
[[nodiscard]] std::uint64_t lost_bytes_of(const std::vector<Damage>& damage, std::uint64_t size);

/// All files of a log as one: chunks are numbered through all parts. Reads chunks and remembers
/// what was in them. Finds chunks by bisection, which works because the indices of a stream only
/// rise. Callers must hold `mutex`.
class LogData {
 public:
  // What to do with files of several recordings.
  enum class Several : std::uint8_t { kRefuse, kTakeNewest };

  LogData(const std::vector<std::filesystem::path>& parts, Several several);
  LogData(const LogData&) = delete;
  LogData& operator=(const LogData&) = delete;
  ~LogData() = default;

  std::mutex mutex;

  [[nodiscard]] const std::vector<std::filesystem::path>& paths() const noexcept { return paths_; }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] bool is_finished() const noexcept;
  [[nodiscard]] const std::map<std::string, std::string>& origin() const noexcept {
    return origin_;
  }
  [[nodiscard]] const std::deque<SessionRecord>& sessions() const noexcept { return sessions_; }
  [[nodiscard]] std::vector<Event> events();
  [[nodiscard]] std::vector<Damage> damage();
  [[nodiscard]] std::uint64_t lost_bytes();

  [[nodiscard]] std::size_t num_chunks() const noexcept { return chunks_.size(); }
  /// Returns what is in chunk `n`. Reads the chunk if that was not done before.
  [[nodiscard]] std::span<const Run> runs(std::size_t n);
  /// Reads all chunks that were not read before.
  void read_all();

  /// Reads chunk `n` and calls `visit(StreamMessage)`, until it returns false.
  template <class Visit>
  void visit(std::size_t n, const Visit& visit) {
    File& file = files_[chunks_[n].file];
    for (const mcap::Message& message : load(n)) {
      ChannelReader* const channel = channel_of(file, message.channel_id);
      if (channel == nullptr) continue;
      const std::optional<StreamMessage> found = identify(file, *channel, message);
      if (found && !visit(*found)) return;
    }
  }

  /// Returns the first chunk that can hold elements of `stream` for which `is_wanted(Run)` holds,
  /// or `num_chunks()` if there is none. `is_wanted` must be false for the first runs of the stream
  /// and true for the rest.
  template <class IsWanted>
  [[nodiscard]] std::size_t find_chunk(const Stream& stream, const IsWanted& is_wanted) {
    std::size_t low = 0;
    std::size_t high = chunks_.size();
    while (low < high) {
      // Find the first chunk, from the middle on, that can say on which side of it the wanted one
      // is.
      std::size_t probe = low + (high - low) / 2;
      const std::size_t middle = probe;
      std::optional<bool> is_behind;
      while (probe < high && !(is_behind = is_at_or_behind(stream, probe, is_wanted))) ++probe;
      if (is_behind.value_or(true)) {
        high = middle;
      } else {
        low = probe + 1;
      }
    }
    return low;
  }
  /// Returns the last run of whole elements of `stream`; nullptr if there is none.
  [[nodiscard]] const Run* last_run(const Stream& stream);
  /// True if chunk `n` shows that neither it nor any later chunk can have elements of `stream`.
  [[nodiscard]] bool is_behind(const Stream& stream, std::size_t n);
  /// Returns an upper limit of the messages of `stream` in the log, whatever the log claims.
  [[nodiscard]] std::size_t max_messages(const Stream& stream) const noexcept;

  /// Returns the steps or elements [first, end) of `stream` that a log without gaps has.
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(const Stream& stream);
  [[nodiscard]] std::vector<Gap> gaps(const Stream& stream);

 private:
  struct File {
    explicit File(const std::filesystem::path& its_path);
    [[nodiscard]] std::int64_t part() const;
    [[nodiscard]] std::string recording() const;
    [[nodiscard]] std::string created() const;

    std::filesystem::path path;
    std::uint64_t size{0};
    mcap::Reader reader;
    std::map<std::string, std::string> origin;
    std::map<std::uint16_t, ChannelReader> channels;
    std::vector<ChannelReader*> channels_by_id;
    // The chunk that was read last.
    std::optional<std::size_t> loaded;
    std::span<const mcap::Message> messages;
  };
  struct Chunk {
    std::size_t file;
    std::size_t index;
    bool is_known{false};
    std::vector<Run> runs;
  };
  class Entries;

  void open(const std::vector<std::filesystem::path>& parts, Several several);
  void leave_newest_recording();
  // Returns false if the messages are ours but cannot be read.
  bool add_channel(File& file, const mcap::Channel& channel);
  void read_record(const File& file, const mcap::Metadata& record);
  void read_session(const Entries& entries);
  void read_end(const Entries& entries);
  void read_gap(const Entries& entries);
  void find_documents(const File& file);
  // Assigns channels to the streams. Returns false if that takes a look at the messages.
  [[nodiscard]] bool guess_channels();
  void ignore(const File& file, const std::string& reason);

  [[nodiscard]] SessionRecord* find_session(const std::string& name, std::uint64_t session_id);
  SessionRecord& add_session(SessionHeader header);
  [[nodiscard]] SessionRecord& session_of(const std::string& name, std::uint64_t session_id);
  static Stream& add_companion(SessionRecord& session, const std::string& name);
  [[nodiscard]] static Stream* find_stream(SessionRecord& session, const std::string& name);
  [[nodiscard]] Stream& stream_of(const ChannelReader& channel, std::uint64_t session_id);
  [[nodiscard]] static bool accepts(const Stream& stream, const ChannelReader& channel);
  static void bind(Stream& stream, const ChannelReader& channel);

  [[nodiscard]] std::span<const mcap::Message> load(std::size_t n);
  void look_into(std::size_t n, std::span<const mcap::Message> messages);
  void add_event(std::size_t n, const mcap::Message& message);
  [[nodiscard]] ChannelReader* channel_of(File& file, std::uint16_t id);
  [[nodiscard]] std::optional<StreamMessage> identify(File& file, ChannelReader& channel,
                                                      const mcap::Message& message);
  [[nodiscard]] TimeIndex first_index(const Stream& stream);
  // Appends the missing elements [first, last] to `gaps`, with the reasons that the log gives.
  static void explain(const Stream& stream, TimeIndex first, TimeIndex last,
                      std::vector<Gap>& gaps);

  template <class IsWanted>
  [[nodiscard]] std::optional<bool> is_at_or_behind(const Stream& stream, std::size_t n,
                                                    const IsWanted& is_wanted) {
    std::optional<bool> answer;
    bool is_own = false;
    for (const Run& run : runs(n)) {
      if (run.stream == &stream && !run.is_end) {
        if (is_wanted(run)) return true;
        answer = false;
        is_own = true;
      } else if (!is_own && is_ordered_ && run.stream->session != stream.session &&
                 run.stream->session->header.name == stream.session->header.name) {
        answer = run.stream->session->order > stream.session->order;
      }
    }
    return answer;
  }

  std::vector<std::filesystem::path> paths_;
  std::vector<File> files_;
  std::vector<Chunk> chunks_;
  std::uint64_t size_{0};
  std::map<std::string, std::string> origin_;
  std::deque<SessionRecord> sessions_;
  // True if the sessions of each robot are known to be in the order of the file.
  bool is_ordered_{true};
  std::map<std::size_t, std::vector<Event>> events_by_chunk_;
  std::vector<Damage> damage_;  // in addition to the damage that the readers found
  std::size_t num_known_{0};    // number of chunks that were read
};

}  // namespace trifinger::log::detail
