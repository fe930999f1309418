// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "ipc/forkable_mutex.hpp"
#include "log/read/channel_reader.hpp"
#include "log/read/log_files.hpp"
#include "log/read/session_table.hpp"
#include "trifinger/log/event.hpp"
#include "trifinger/log/log.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::log::detail {

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

/// A message with an image. Its bytes are valid until another chunk is read.
struct ImageMessage {
  bool is_compressed{false};
  std::span<const std::byte> message;
};

/// All files of a log as one: chunks are numbered through all parts. Reads chunks and remembers
/// what was in them. Finds chunks by bisection, which works because the indices of a stream only
/// rise. Callers must hold `mutex`.
class LogData {
 public:
  LogData(const std::vector<std::filesystem::path>& parts, Several several);
  LogData(const LogData&) = delete;
  LogData& operator=(const LogData&) = delete;
  ~LogData() = default;

  ipc::ForkableMutex mutex;

  [[nodiscard]] const std::vector<std::filesystem::path>& paths() const noexcept { return paths_; }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] bool is_finished() const noexcept;
  [[nodiscard]] const std::map<std::string, std::string>& origin() const noexcept {
    return origin_;
  }
  [[nodiscard]] const std::deque<SessionRecord>& sessions() const noexcept {
    return sessions_.sessions();
  }
  [[nodiscard]] std::vector<Event> events();
  [[nodiscard]] std::vector<Damage> damage();
  [[nodiscard]] std::uint64_t lost_bytes();

  [[nodiscard]] std::size_t num_chunks() const noexcept { return chunks_.size(); }
  /// Returns what is in chunk `n`. Reads the chunk if that was not done before.
  [[nodiscard]] std::span<const Run> runs(std::size_t n);
  /// Reads all chunks that were not read before and may have elements or events.
  void read_all();

  /// Reads chunk `n` and calls `visit(StreamMessage)`, until it returns false.
  template <class Visit>
  void visit(std::size_t n, const Visit& visit) {
    if (!chunks_[n].has_elements) return;
    LogFile& file = files_[chunks_[n].file];
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

  /// Returns the image of the robot's camera that belongs to element `element` of its companion and
  /// was taken at `time`.
  [[nodiscard]] std::optional<ImageMessage> find_image(const std::string& robot,
                                                       const std::string& camera, std::int64_t time,
                                                       TimeIndex element);

  /// Returns the steps or elements [first, end) of `stream` that a log without gaps has.
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(const Stream& stream);
  [[nodiscard]] std::vector<Gap> gaps(const Stream& stream);

 private:
  struct Chunk {
    std::size_t file;
    std::size_t index;
    bool has_elements{true};  // false: it certainly has neither elements nor events
    bool is_known{false};
    std::vector<Run> runs;
  };
  // Returns false if the messages are ours but cannot be read.
  bool add_channel(LogFile& file, const mcap::Channel& channel);
  void ignore(const LogFile& file, const std::string& reason);
  // Finds the chunks without elements, most of which have images.
  void mark_chunks(LogFile& file);
  // Reads every byte that was not read before.
  void verify_all();
  [[nodiscard]] bool may_have_images(const Chunk& chunk);
  [[nodiscard]] std::optional<ImageMessage> find_image_in(std::size_t n, const std::string& robot,
                                                          const std::string& camera,
                                                          std::int64_t time, TimeIndex element);

  [[nodiscard]] std::span<const mcap::Message> load(std::size_t n);
  void look_into(std::size_t n, std::span<const mcap::Message> messages);
  void add_event(std::size_t n, const mcap::Message& message);
  [[nodiscard]] ChannelReader* channel_of(LogFile& file, std::uint16_t id);
  [[nodiscard]] std::optional<StreamMessage> identify(LogFile& file, ChannelReader& channel,
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
      } else if (const int order = sessions_.compare(*run.stream, stream); !is_own && order != 0) {
        answer = order > 0;
      }
    }
    return answer;
  }

  std::vector<Damage> damage_;  // in addition to the damage that the readers found
  std::vector<LogFile> files_;
  std::vector<std::filesystem::path> paths_;
  std::vector<Chunk> chunks_;
  std::uint64_t size_{0};
  std::map<std::string, std::string> origin_;
  SessionTable sessions_;
  std::map<std::size_t, std::vector<Event>> events_by_chunk_;
  std::size_t num_known_{0};  // number of chunks that were read or need not be read
  bool is_verified_{false};
  std::optional<std::vector<std::size_t>> image_chunks_;  // those that may have images
  std::size_t next_image_{0};  // where the next one probably is among `image_chunks_`
};

}  // namespace trifinger::log::detail
