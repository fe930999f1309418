// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "session_recorder.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/ipc/file_descriptor.hpp"
#include "trifinger/ipc/process.hpp"
#include "trifinger/log/log_writer.hpp"
#include "trifinger/log/recorder.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::log {

[[nodiscard]] inline Instant now() noexcept { return std::chrono::steady_clock::now(); }

// The right to record one robot into one folder, as long as the object lives.
class RecordingLock {
 public:
  // `robot_process`: the process with which the recorder ends, if there is one. Waits for an owner
  // whose own such process is gone, since that one is about to finish. Throws AlreadyRecorded,
  // SystemError.
  RecordingLock(const std::filesystem::path& folder, const std::string& robot,
                const std::optional<ipc::ProcessIdentity>& robot_process);
  RecordingLock(RecordingLock&&) noexcept = default;
  RecordingLock& operator=(RecordingLock&&) = delete;
  RecordingLock(const RecordingLock&) = delete;
  RecordingLock& operator=(const RecordingLock&) = delete;
  ~RecordingLock();

 private:
  std::filesystem::path path_;
  ipc::FileDescriptor file_;
};

// The files of a recording: their names, when one ends and the next begins, what is removed, and
// where an earlier recorder has left off. Everything that can fail because of the disk throws
// SystemError and is tried again by the next call.
class Recording {
 public:
  using Tell = SessionRecorder::Tell;

  // Looks at what is in the folder. Throws AlreadyRecorded, InvalidArgument, SystemError.
  Recording(const std::vector<std::string>& robots, const RecorderOptions& options, Tell tell);

  // Where earlier recorders have left this session; nothing if they knew nothing of it.
  [[nodiscard]] std::optional<Position> find(const std::string& robot,
                                             std::uint64_t session_id) const;
  // Sessions of the robot whose end is not in the recording that was cut off and goes on.
  [[nodiscard]] std::vector<std::uint64_t> open_sessions(const std::string& robot) const;
  // True if the recording of `file` was cut off and goes on.
  [[nodiscard]] bool is_unfinished(const std::filesystem::path& file) const;
  // Makes what is written from now on the next part of the recording that ends with `path`. False
  // if that cannot be.
  [[nodiscard]] bool join(const std::filesystem::path& path);
  // The newest time in the files of earlier recorders, since 1970 [ns]; 0 if there are none.
  [[nodiscard]] std::int64_t last_time() const noexcept { return last_time_; }

  // The log to write to. Opens a file where none is.
  [[nodiscard]] LogWriter& log();
  [[nodiscard]] bool is_open() const noexcept { return log_ != nullptr; }
  // Of the open file; another number for each.
  [[nodiscard]] int number() const noexcept { return part_; }

  // Hands the open chunk to the kernel if it is time, or at once if that is wanted. Then looks
  // after the files: sync, rotation, limits.
  void flush(bool is_wanted);
  // Finishes the open file, or the one that an earlier recorder has left unfinished.
  void finish();

  [[nodiscard]] std::filesystem::path path() const;
  // Written by this object, all files together.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

 private:
  // A file of these robots, of whatever recording.
  struct File {
    std::filesystem::path path;
    std::string stem;  // up to the part: the same for all files of a recording
    int part{0};
    std::uint64_t size{0};
  };
  struct Unfinished {
    File file;
    std::unique_ptr<mcap::Reader> reader;
  };

  [[nodiscard]] std::vector<File> find_files() const;
  void look_at(std::vector<File> files);
  void take_over(Unfinished unfinished);
  void take_name_of(const File& file, const mcap::Contents& contents);
  void open();
  void open_new();
  void go_on(const Unfinished& unfinished);
  void finish_file();
  void sync();
  void require_room();
  void remove_oldest();
  [[nodiscard]] std::uint64_t rotate_size() const noexcept;

  const RecorderOptions& options_;
  Tell tell_;
  std::vector<RecordingLock> locks_;
  std::string name_;  // of the robots, as in the names of files
  std::string stem_;
  std::string id_;
  int part_{0};
  std::int64_t last_time_{0};
  std::vector<File> earlier_;  // newest first
  std::optional<Unfinished> unfinished_;
  bool was_cut_off_{false};  // and goes on in this object
  bool has_joined_{false};
  std::deque<File> finished_;  // parts of this recording, oldest first

  std::filesystem::path path_;
  std::unique_ptr<mcap::Sink> sink_;
  std::unique_ptr<LogWriter> log_;
  std::uint64_t begun_at_{0};  // size of the file when this object took it
  std::uint64_t bytes_of_finished_{0};
  Instant file_begun_;
  std::optional<Instant> chunk_begun_;
  Instant last_sync_;
  std::uint64_t synced_size_{0};
  Instant last_look_;  // at the disk
};

}  // namespace trifinger::log
