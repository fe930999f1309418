// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/log/message_layout.hpp"
#include "trifinger/mcap/writer.hpp"

namespace trifinger::log {

/// What a log says of a session at its beginning; docs/log_format.md.
struct SessionHeader {
  std::string name;
  std::uint64_t session_id{0};
  bool is_real_time{false};
  /// Real-time mode: see `SessionInfo`; nothing if it was not written down.
  std::optional<std::vector<std::string>> realtime_lacks{};
  Nanoseconds period{0};
  std::int64_t created{0};  ///< Since 1970 [ns].
  /// What turns times of the session into times since 1970 [ns]: in real-time mode the wall clock
  /// minus the monotonic clock, otherwise when step 0 was, t periods before step t.
  std::int64_t time_offset{0};
  std::string host;
  std::int64_t backend_pid{0};
  RobotTypes types;
  struct Companion {
    std::string name;  ///< As in "sim.object".
    std::string type;
    ElementDescription element;
    TimeIndex first_index{0};  ///< First element in this file.
  };
  std::vector<Companion> companions;
  std::vector<Document> documents;
  TimeIndex first_index{0};  ///< First step in this file.

  /// What a session says of itself.
  [[nodiscard]] static SessionHeader of(const Session& robot,
                                        const std::vector<Session>& companions);
};

struct LogOptions {
  Precision precision{Precision::kDouble};
  mcap::Compression compression{mcap::Compression::kZstd};
  int level{1};
  std::string recording;  ///< The same for all files of a recording.
  int part{0};            ///< Number of this file among them.
  /// How often 3D viewers are told where the links of a robot are that has the documents
  /// "robot.urdf" and "frames.txt" [1/s]; 0: they are told nothing.
  double viewer_rate{8.0};
};

/// Writes sessions into one file; knows the format, but neither where the elements come from nor
/// how many files there are.
///
/// Like `mcap::Writer` it loses nothing if the sink throws SystemError: the same call tries again.
/// `write_steps` and `write_companion` do not throw as long as there is room in the open chunk;
/// where they do, a part of the elements may have been written.
class LogWriter {
 public:
  /// Begins a file. `sink` must be empty and outlive the writer.
  LogWriter(mcap::Sink& sink, const LogOptions& options);
  /// Goes on with a file that was not finished, of the same precision.
  LogWriter(mcap::Sink& sink, const LogOptions& options, const mcap::Contents& contents);
  LogWriter(LogWriter&&) noexcept;
  LogWriter& operator=(LogWriter&&) noexcept;
  ~LogWriter();

  /// Begins a session, or goes on with one that is in the file. Returns the number that the
  /// functions below want.
  /// @throws InvalidArgument if a type or field has a name that a log cannot have
  std::size_t begin_session(const SessionHeader& header);

  /// Pointers to `count` elements each, of the steps from `first` on.
  struct Steps {
    TimeIndex first{0};
    std::size_t count{0};
    const void* desired_actions{nullptr};
    const void* applied_actions{nullptr};
    const void* observations{nullptr};
    const void* statuses{nullptr};
  };
  void write_steps(std::size_t session, const Steps& steps);
  void write_companion(std::size_t session, std::size_t companion, TimeIndex first,
                       std::size_t count, const void* elements);
  /// y_N and its status; `observation` is nullptr where the driver could not deliver it.
  void write_end(std::size_t session, TimeIndex time_index, const void* observation,
                 const Status& status);
  /// Nothing may follow.
  void end_session(std::size_t session, TimeIndex steps, const Fault& fault,
                   std::string_view fault_text);
  /// The steps `first` to `last`, both included, are not in the file.
  void write_gap(std::size_t session, TimeIndex first, TimeIndex last, std::string_view reason);
  /// The same for elements of a companion.
  void write_companion_gap(std::size_t session, std::size_t companion, TimeIndex first,
                           TimeIndex last, std::string_view reason);

  /// As in rcl_interfaces/msg/Log.
  enum class Level : std::uint8_t { kInfo = 20, kWarning = 30, kError = 40 };
  /// A sentence for people. `time` since 1970 [ns].
  void write_event(Level level, std::string_view source, std::string_view text, std::int64_t time);

  /// Closes the open chunk and hands it to the sink.
  void flush();
  /// The same, and the summary.
  void finish();
  /// Bytes of messages in the open chunk. It is closed by itself above `kMaxChunkSize`.
  [[nodiscard]] std::size_t open_chunk_size() const noexcept;
  static constexpr std::size_t kMaxChunkSize = std::size_t{1} << 20U;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// What the clock on the wall shows: since 1970 [ns].
[[nodiscard]] std::int64_t wall_time() noexcept;

}  // namespace trifinger::log
