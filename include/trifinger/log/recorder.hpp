// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/follower.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/process.hpp"
#include "trifinger/log/log_writer.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::log {

/// Another recorder writes one of these robots into this folder.
class AlreadyRecorded : public Error {
 public:
  using Error::Error;
};

/// How to record.
struct RecorderOptions {
  std::filesystem::path folder{"."};  ///< Is made if it is not there.
  Precision precision{Precision::kDouble};
  mcap::Compression compression{mcap::Compression::kZstd};
  int level{1};  ///< Of the compression.

  std::uint64_t rotate_size{1'000'000'000};  ///< Largest size of a file [bytes].
  Nanoseconds rotate_time{kForever};         ///< Longest time in one file.
  /// All files of this recording together, 0: no limit; the oldest are removed. A file is then at
  /// most an eighth of it [bytes].
  std::uint64_t max_total{0};
  /// What is left free on the disk; with less, recording waits [bytes].
  std::uint64_t keep_free{100'000'000};
  /// How often what was written is made to survive a loss of power, which happens at the end of
  /// every file besides. The death of a program, ours included, costs nothing that was written.
  Nanoseconds sync_period{std::chrono::seconds(5)};

  /// `run` returns once every robot has had a session and its back-end is gone.
  bool until_end{false};
  /// `run` returns once this process is gone.
  std::optional<ipc::ProcessIdentity> until_process_ends{};
  /// The sessions come from the back-end of this process, by `begin_session`; nobody looks for
  /// them.
  bool is_follower{false};

  /// Something worth telling people. It is in the log, too.
  struct Event {
    std::int64_t time{0};  ///< Since 1970 [ns].
    LogWriter::Level level{LogWriter::Level::kInfo};
    std::string source;  ///< The robot whose session it is about, or "recorder".
    std::string text;    ///< A sentence.
  };
  /// Is called by the thread of `run`. Must not throw.
  std::function<void(const Event&)> on_event{};

  /// Makes a file, or goes on with one at byte `size`: `mcap::FileSink`, if nothing else is given.
  using OpenFile = std::function<std::unique_ptr<mcap::Sink>(const std::filesystem::path& path,
                                                             std::optional<std::uint64_t> size)>;
  OpenFile open_file{};
};

/// How a recorder is doing.
struct RecorderState {
  struct Robot {
    std::string name;
    std::uint64_t session_id{0};  ///< 0: none has been found yet.
    bool is_recording{false};     ///< The session goes on.
    TimeIndex next_step{0};       ///< All before are in the log, or were lost.
    double lag{0.0};              ///< How much of the history is still to be read, 0 to 1.
  };
  std::vector<Robot> robots;
  std::filesystem::path file;  ///< The newest; empty before the first.
  std::uint64_t bytes{0};      ///< Written by this recorder, all files together.
  std::int64_t steps{0};       ///< Likewise.
  std::int64_t lost_steps{0};  ///< Overwritten before they could be read. Each has its gap.
  std::string trouble;         ///< Why nothing can be written at present; empty if all is well.
  /// Another number each time the recorder gets on, even if there is nothing to write. One that
  /// stays the same for seconds belongs to a recorder whose disk hangs.
  std::uint64_t progress{0};
};

/// Writes what robots do, all series and companions, into one recording: files of one after the
/// other, `NAME_2026-11-20_09-05-12_000.mcap`.
///
/// Only looks: it polls, about every 20 ms, so that a robot never makes a system call for it. Steps
/// are in the hands of the kernel at most 100 ms later. Whatever keeps it from writing - a full
/// disk, an error, its own death - costs nothing as long as the history of the session still holds
/// what is missing: the next recorder of the same robots and folder goes on where the last one was
/// cut off. What the history has lost is written down as a gap.
///
/// As a follower of a back-end in its own process it loses nothing outside real-time mode either,
/// as the back-end waits for it.
class Recorder final : public Follower {
 public:
  /// Takes the right to record `robots` into the folder. Sessions are looked for by `run`.
  ///
  /// A recorder whose process to end with is gone (`until_process_ends`) has this right until it
  /// has finished its file: this waits for it, at most 10 s.
  /// @throws AlreadyRecorded, InvalidArgument, SystemError
  Recorder(const std::vector<std::string>& robots, RecorderOptions options);
  ~Recorder() override;

  /// Records in the calling thread until `request_stop`; then what is there is written and the file
  /// is finished.
  /// @throws SystemError if the end cannot be written. The next recorder goes on where this one was
  /// cut off.
  void run();
  /// May be called from any thread or signal handler.
  void request_stop() noexcept;
  /// May be called from any thread.
  [[nodiscard]] RecorderState state() const;

  void begin_session(const Session& robot,
                     const std::vector<Session>& companions) noexcept override;
  [[nodiscard]] TimeIndex next_step() const noexcept TRIFINGER_REALTIME override;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace trifinger::log
