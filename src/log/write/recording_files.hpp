// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "log/log_writer.hpp"
#include "log/recorder.hpp"
#include "log/write/recorded_position.hpp"
#include "log/write/recording_lock.hpp"
#include "log/write/session_copier.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::log::detail {

// The files of a recording. Chooses their names, decides when one ends and the next begins, removes
// old ones, and finds where an earlier recorder stopped. Functions that the disk can make fail
// throw SystemError; the next call tries again.
class RecordingFiles {
 public:
  using Report = SessionCopier::Report;

  // Reads the folder. Throws AlreadyRecorded, InvalidArgument, SystemError.
  RecordingFiles(const std::vector<std::string>& robots, const RecorderOptions& options,
                 Report report);

  // Returns how far earlier recorders have recorded this session; nothing if they do not know it.
  [[nodiscard]] std::optional<RecordedPosition> find(const std::string& robot,
                                                     std::uint64_t session_id) const;
  // Returns the sessions of the robot that have no end in the continued recording.
  [[nodiscard]] std::vector<std::uint64_t> open_sessions(const std::string& robot) const;
  // True if the recording of `file` was cut off and is continued now.
  [[nodiscard]] bool is_unfinished(const std::filesystem::path& file) const;
  // Makes the next file a part of the recording that ends with `path`. Returns false if that is not
  // possible.
  [[nodiscard]] bool join(const std::filesystem::path& path);
  // Returns the newest time in the files of earlier recorders, since 1970 [ns]; 0 if there are
  // none.
  [[nodiscard]] std::int64_t last_time() const noexcept { return last_time_; }

  // Returns the log to write to. Opens a file if none is open.
  [[nodiscard]] LogWriter& log();
  [[nodiscard]] bool is_open() const noexcept { return log_ != nullptr; }
  // Returns the number of the open file; each file has a different one.
  [[nodiscard]] int number() const noexcept { return part_; }

  // Hands the open chunk to the kernel if it is time, or at once if `is_wanted`. Then does what the
  // files need: sync, rotation, limits.
  void flush(bool is_wanted);
  // Finishes the open file, or the file that an earlier recorder left unfinished.
  void finish();

  [[nodiscard]] std::filesystem::path path() const;
  // Returns the number of bytes written by this object in all files.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

 private:
  // A file of these robots, from any recording.
  struct File {
    std::filesystem::path path;
    std::string stem;  // name without the part: the same for all files of a recording
    int part{0};
    std::uint64_t size{0};
  };
  struct Unfinished {
    File file;
    std::unique_ptr<mcap::Reader> reader;
  };

  [[nodiscard]] std::vector<File> find_files() const;
  void find_unfinished(std::vector<File> files);
  void take_over(Unfinished unfinished);
  void take_name_of(const File& file, const mcap::Contents& contents);
  void open();
  void open_new();
  [[nodiscard]] std::unique_ptr<mcap::Sink> open_file(const std::filesystem::path& path,
                                                      std::optional<std::uint64_t> size) const;
  [[nodiscard]] LogOptions log_options() const;
  // Takes a file that has `size` bytes.
  void begin_file(std::unique_ptr<mcap::Sink> sink, const std::filesystem::path& path,
                  std::uint64_t size);
  void go_on(const Unfinished& unfinished);
  void finish_file();
  void sync();
  void require_room();
  void remove_oldest();
  [[nodiscard]] std::uint64_t rotate_size() const noexcept;

  const RecorderOptions& options_;
  Report report_;
  std::vector<RecordingLock> locks_;
  std::string name_;  // names of the robots, as in the names of files
  std::string stem_;
  std::string id_;
  int part_{0};
  std::int64_t last_time_{0};
  std::vector<File> earlier_;  // newest first
  std::optional<Unfinished> unfinished_;
  bool was_cut_off_{false};  // the recording was cut off and is continued by this object
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
  Instant last_look_;  // last look at the disk
};

}  // namespace trifinger::log::detail
