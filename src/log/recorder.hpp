// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "log/image_storage.hpp"
#include "log/message_layout.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/follower.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/process.hpp"
#include "trifinger/log/event.hpp"
#include "trifinger/mcap/records.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::log {

/// Another recorder writes one of these robots into this folder.
class AlreadyRecorded : public Error {
 public:
  using Error::Error;
};

/// How to record.
struct RecorderOptions {
  std::filesystem::path folder{"."};  ///< Is made if it does not exist.
  Precision precision{Precision::kDouble};
  mcap::Compression compression{mcap::Compression::kZstd};
  int level{1};  ///< Level of the compression.

  ImageStorage images{ImageStorage::kJpeg};  ///< What is kept of the images of a robot's cameras.
  int jpeg_quality{90};                      ///< 1 to 100.

  std::uint64_t rotate_size{1'000'000'000};  ///< Largest size of a file [bytes].
  Nanoseconds rotate_time{kForever};         ///< Longest time in one file.
  /// Largest size of all files of this recording together; the oldest are removed [bytes]. 0: no
  /// limit. Each file then has at most an eighth of this size.
  std::uint64_t max_total{0};
  /// Space that stays free on the disk. If there is less, recording waits [bytes].
  std::uint64_t keep_free{100'000'000};
  /// How often written data is made safe against a loss of power. This also happens at the end of
  /// every file. If only a program dies, this one included, no written data is lost.
  Nanoseconds sync_period{std::chrono::seconds(5)};

  /// `run` returns once every robot has had a session and its back-end has ended.
  bool until_end{false};
  /// `run` returns once this process has ended.
  std::optional<ipc::ProcessIdentity> until_process_ends{};
  /// The back-end of this process hands over the sessions with `begin_session`; the recorder does
  /// not search for sessions.
  bool is_follower{false};

  /// Called by the thread of `run` for every event that goes into the log. Must not throw.
  std::function<void(const Event&)> on_event{};

  /// Makes a file, or continues one at byte `size`. Default: `mcap::FileSink`.
  using OpenFile = std::function<std::unique_ptr<mcap::Sink>(const std::filesystem::path& path,
                                                             std::optional<std::uint64_t> size)>;
  OpenFile open_file{};
};

/// The current state of a recorder.
struct RecorderState {
  struct Robot {
    std::string name;
    std::uint64_t session_id{0};  ///< 0: no session has been found yet.
    bool is_recording{false};     ///< The session is running and is being recorded.
    TimeIndex next_step{0};       ///< All earlier steps are in the log or were lost.
    double lag{0.0};              ///< Share of the history that is still to be read, 0 to 1.
  };
  std::vector<Robot> robots;
  std::filesystem::path file;  ///< The newest file; empty before the first one.
  std::uint64_t bytes{0};      ///< Size of all files written by this recorder.
  std::int64_t steps{0};       ///< Number of steps written by this recorder.
  std::int64_t lost_steps{0};  ///< Steps overwritten before they could be read. Each is in a gap.
  std::int64_t images{0};      ///< Number of images taken for the log.
  /// Number of images that were overwritten before they could be taken, or found no room.
  std::int64_t left_out_images{0};
  std::string error;  ///< Why nothing can be written now; empty if recording works.
  /// This number changes whenever the recorder makes progress, even if there is nothing to write.
  /// If it stays the same for seconds, the recorder's disk hangs.
  std::uint64_t progress{0};
};

/// Writes all series of robots and companions into one recording: files that follow each other,
/// such as `NAME_2026-11-20_09-05-12_000.mcap`.
///
/// The recorder only reads. It polls about every 20 ms, so a robot never makes a system call for
/// it. The kernel has each step at most 100 ms later. A full disk, an error or the recorder's own
/// death may stop the writing. No data is lost as long as the session's history still holds the
/// missing steps: the next recorder of the same robots and folder continues where the last one
/// stopped. Steps that the history has lost are recorded as a gap.
///
/// A recorder may follow a back-end in its own process. Then it loses nothing outside real-time
/// mode either, because the back-end waits for it. `RecorderThread` is such a recorder with a
/// thread of its own.
class Recorder final : public Follower {
 public:
  /// Takes the right to record `robots` into the folder. `run` searches for sessions.
  ///
  /// Another recorder keeps the right until it has finished its file. If it is about to finish,
  /// because the process of its `until_process_ends` has ended, this waits for it, at most 10 s.
  /// @throws AlreadyRecorded, InvalidArgument, SystemError
  Recorder(const std::vector<std::string>& robots, RecorderOptions options);
  ~Recorder() override;

  /// Records in the calling thread until `request_stop`. Then it writes the available steps and
  /// finishes the file.
  /// @throws SystemError if the end cannot be written. The next recorder continues where this one
  /// stopped.
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
