// SPDX-License-Identifier: BSD-3-Clause
#include "log/write/recording_files.hpp"

#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <set>
#include <string_view>
#include <utility>

#include "log/format/format.hpp"
#include "log/format/records.hpp"
#include "log/format/text.hpp"
#include "log/write/next_date.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/mcap/reader.hpp"
#include "trifinger/mcap/records.hpp"

namespace trifinger::log::detail {
namespace {

// With a look every 20 ms, a chunk is written at the fourth look, when its first step is 80 ms old.
// Larger chunks make smaller files: with 80 steps a step takes 318 bytes, with 40 steps 322 bytes.
constexpr Nanoseconds kChunkTime = std::chrono::milliseconds(45);
constexpr Nanoseconds kLookPeriod = std::chrono::seconds(1);
constexpr std::size_t kMaxName = 160;
// Far below overflow, whatever a damaged file claims.
constexpr std::uint64_t kEndOfTime = std::uint64_t{1} << 62U;
// A session that is still running can only be in the newest files.
constexpr std::size_t kMaxFilesToSearch = 8;

std::string file_name(const std::string& stem, int part) {
  std::array<char, 16> number{};
  std::snprintf(number.data(), number.size(), "_%03d", part);
  return stem + number.data() + std::string(kLogSuffix);
}

// Throws if a robot's name cannot be part of a file's name.
void require_names(const std::vector<std::string>& robots) {
  if (robots.empty()) throw InvalidArgument("a recorder needs the name of a robot");
  std::set<std::string> seen;
  for (const std::string& name : robots) {
    const auto is_allowed = [](char c) {
      return is_lower(c) || is_upper(c) || is_digit(c) || c == '_' || c == '-';
    };
    if (name.empty() || name.front() == '-' || !std::ranges::all_of(name, is_allowed)) {
      throw InvalidArgument("'" + name + "' is not the name of a robot" +
                            (name.find('.') == std::string::npos
                                 ? ""
                                 : "; companions are recorded with their robot"));
    }
    if (!seen.insert(name).second) {
      throw InvalidArgument("robot '" + name + "' is named twice");
    }
  }
}

std::string joined(const std::vector<std::string>& robots) {
  require_names(robots);
  std::string name;
  for (const std::string& robot : robots) name += (name.empty() ? "" : "+") + robot;
  if (name.size() > kMaxName) {
    throw InvalidArgument("the names of " + std::to_string(robots.size()) +
                          " robots are too long for that of a file: record fewer into one");
  }
  return name;
}

// Returns what the file says about itself under `key`.
std::string log_entry(const mcap::Contents& contents, const std::string& key) {
  for (const mcap::Metadata& record : contents.metadata) {
    if (record.name == kLogRecord) return entry_of(record.entries, key);
  }
  return {};
}

}  // namespace

RecordingFiles::RecordingFiles(const std::vector<std::string>& robots,
                               const RecorderOptions& options, Report report)
    : options_(options), report_(std::move(report)), name_(joined(robots)) {
  std::error_code error;
  std::filesystem::create_directories(options_.folder, error);
  if (error) throw SystemError("make the folder " + options_.folder.string(), error.value());
  for (const std::string& robot : robots) {
    locks_.emplace_back(options_.folder, robot, options_.until_process_ends);
  }
  find_unfinished(find_files());
}

std::vector<RecordingFiles::File> RecordingFiles::find_files() const {
  std::vector<File> files;
  for (const auto& found : std::filesystem::directory_iterator(options_.folder)) {
    const std::string name = found.path().filename().string();
    if (!name.ends_with(kLogSuffix) || !name.starts_with(name_ + "_")) continue;
    const std::string body = name.substr(0, name.size() - kLogSuffix.size());
    const std::size_t stem_size = name_.size() + 1 + kDatePattern.size();
    if (body.size() < stem_size + 4 || body[stem_size] != '_' ||
        !is_date(std::string_view(body).substr(name_.size() + 1, kDatePattern.size()))) {
      continue;
    }
    struct stat status{};
    // Files of other users are neither continued nor removed.
    if (::lstat(found.path().c_str(), &status) != 0 || !S_ISREG(status.st_mode) ||
        status.st_uid != ::geteuid()) {
      continue;
    }
    File file{.path = found.path(),
              .stem = body.substr(0, stem_size),
              .size = static_cast<std::uint64_t>(status.st_size)};
    const char* const digits = body.c_str() + stem_size + 1;
    const char* const end = body.c_str() + body.size();
    const auto result = std::from_chars(digits, end, file.part);
    if (result.ec != std::errc() || result.ptr != end || file.part < 0) continue;
    files.push_back(std::move(file));
  }
  std::ranges::sort(files, [](const File& a, const File& b) {
    return std::tie(b.stem, b.part) < std::tie(a.stem, a.part);
  });
  return files;
}

// Finds the recording that an earlier recorder left unfinished, if it is the newest one.
void RecordingFiles::find_unfinished(std::vector<File> files) {
  earlier_ = std::move(files);
  // The recorders of empty files were killed before the first byte.
  std::erase_if(earlier_, [](const File& file) {
    std::error_code ignored;
    return file.size == 0 && std::filesystem::remove(file.path, ignored);
  });
  for (const File& file : earlier_) {
    try {
      auto reader = std::make_unique<mcap::Reader>(file.path);
      const mcap::Contents& contents = reader->contents();
      for (const mcap::ChunkPlace& chunk : contents.chunks) {
        last_time_ =
            std::max(last_time_, static_cast<std::int64_t>(std::min(chunk.last_time, kEndOfTime)));
      }
      const std::string precision = log_entry(contents, "precision");
      if (!contents.is_finished &&
          (precision == name_of(options_.precision) || contents.metadata.empty())) {
        take_over({.file = file, .reader = std::move(reader)});
        return;
      }
      break;
    } catch (const Error& error) {
      report_(Level::kWarning, kRecorder, file.path.string() + " cannot be read: " + error.what());
    }
  }
  id_ = random_id();
  stem_ = name_ + "_" + next_date(options_.folder);
}

void RecordingFiles::take_over(Unfinished unfinished) {
  take_name_of(unfinished.file, unfinished.reader->contents());
  unfinished_ = std::move(unfinished);
  was_cut_off_ = true;
}

// Makes the next files continue the recording of `file`.
void RecordingFiles::take_name_of(const File& file, const mcap::Contents& contents) {
  stem_ = file.stem;
  part_ = file.part;
  id_ = log_entry(contents, "recording");
  finished_.clear();
  for (const File& other : earlier_) {
    if (other.stem != stem_ || other.part >= part_) continue;
    finished_.push_front(other);
    // The file may have been cut off before its first record. Earlier parts have the id as well.
    if (id_.empty()) id_ = log_entry(mcap::Reader(other.path).contents(), "recording");
  }
  if (id_.empty()) id_ = random_id();
}

std::vector<std::uint64_t> RecordingFiles::open_sessions(const std::string& robot) const {
  std::vector<std::uint64_t> open;
  if (!unfinished_) return open;
  for (const mcap::Metadata& record : unfinished_->reader->contents().metadata) {
    if (entry_of(record.entries, "name") != robot) continue;
    const auto id = number_of<std::uint64_t>(entry_of(record.entries, "session_id")).value_or(0);
    if (record.name == kSessionRecord) open.push_back(id);
    if (record.name == kEndRecord) std::erase(open, id);
  }
  return open;
}

bool RecordingFiles::is_unfinished(const std::filesystem::path& file) const {
  return std::ranges::any_of(earlier_, [&](const File& known) {
    return known.path == file && known.stem == stem_ && was_cut_off_;
  });
}

bool RecordingFiles::join(const std::filesystem::path& path) {
  if (was_cut_off_ || log_ != nullptr || earlier_.empty() || earlier_.front().path != path)
    return false;
  if (has_joined_) return true;
  const File file = earlier_.front();
  const mcap::Reader reader(path);
  if (log_entry(reader.contents(), "precision") != name_of(options_.precision)) return false;
  take_name_of(file, reader.contents());
  finished_.push_back(file);
  ++part_;
  has_joined_ = true;
  return true;
}

std::optional<RecordedPosition> RecordingFiles::find(const std::string& robot,
                                                     std::uint64_t session_id) const {
  std::size_t searched = 0;
  for (const File& file : earlier_) {
    if (++searched > kMaxFilesToSearch) break;
    try {
      const bool is_open = unfinished_ && unfinished_->file.path == file.path;
      mcap::Reader* reader = is_open ? unfinished_->reader.get() : nullptr;
      std::optional<mcap::Reader> own;
      if (reader == nullptr) reader = &own.emplace(file.path);
      auto position = find_position(*reader, robot, session_id);
      if (!position) continue;
      position->file = file.path;
      return position;
    } catch (const Error&) {
      // The file cannot be read, or was removed meanwhile: the position in it is lost.
    }
  }
  return std::nullopt;
}

LogWriter& RecordingFiles::log() {
  if (log_ == nullptr) open();
  return *log_;
}

void RecordingFiles::open() {
  require_room();
  if (unfinished_) {
    const Unfinished unfinished = std::move(*unfinished_);
    unfinished_.reset();
    try {
      go_on(unfinished);
      return;
    } catch (const SystemError&) {
      unfinished_ = {.file = unfinished.file,
                     .reader = std::make_unique<mcap::Reader>(unfinished.file.path)};
      throw;
    } catch (const InvalidArgument& error) {
      report_(Level::kWarning, kRecorder,
              "cannot go on with " + unfinished.file.path.string() + ": " + error.what() +
                  "; begins another file");
      ++part_;
    }
  }
  open_new();
}

void RecordingFiles::open_new() {
  std::unique_ptr<mcap::Sink> sink;
  std::filesystem::path path;
  while (sink == nullptr) {
    path = options_.folder / file_name(stem_, part_);
    try {
      sink = open_file(path, std::nullopt);
    } catch (const SystemError& error) {
      if (error.error_number() != EEXIST) throw;
      ++part_;
    }
  }
  try {
    log_ = std::make_unique<LogWriter>(*sink, log_options());
  } catch (...) {
    // No byte was written, so the next attempt creates the file again.
    sink.reset();
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    throw;
  }
  begin_file(std::move(sink), path, 0);
  report_(Level::kInfo, kRecorder, "records into " + path_.string());
}

void RecordingFiles::go_on(const Unfinished& unfinished) {
  const mcap::Contents& contents = unfinished.reader->contents();
  std::unique_ptr<mcap::Sink> sink = open_file(unfinished.file.path, contents.complete_size);
  log_ = std::make_unique<LogWriter>(*sink, log_options(), contents);
  begin_file(std::move(sink), unfinished.file.path, contents.complete_size);
  std::string text = "goes on with " + path_.string() + ", which another recorder has left";
  if (unfinished.file.size > contents.complete_size) {
    text += "; " + std::to_string(unfinished.file.size - contents.complete_size) +
            " bytes at its end were half written";
  }
  report_(Level::kWarning, kRecorder, text);
}

std::unique_ptr<mcap::Sink> RecordingFiles::open_file(const std::filesystem::path& path,
                                                      std::optional<std::uint64_t> size) const {
  if (options_.open_file) return options_.open_file(path, size);
  return std::make_unique<mcap::FileSink>(size ? mcap::FileSink::resume(path, *size)
                                               : mcap::FileSink::create(path));
}

LogOptions RecordingFiles::log_options() const {
  return {.precision = options_.precision,
          .compression = options_.compression,
          .level = options_.level,
          .recording = id_,
          .part = part_};
}

void RecordingFiles::begin_file(std::unique_ptr<mcap::Sink> sink, const std::filesystem::path& path,
                                std::uint64_t size) {
  sink_ = std::move(sink);
  path_ = path;
  begun_at_ = size;
  file_begun_ = last_sync_ = now();
  synced_size_ = 0;
}

void RecordingFiles::flush(bool is_wanted) {
  if (log_ == nullptr) return;
  const Instant time = now();
  if (log_->open_chunk_size() == 0) {
    chunk_begun_.reset();
  } else {
    if (!chunk_begun_) chunk_begun_ = time;
    if (is_wanted || time - *chunk_begun_ >= kChunkTime) {
      require_room();
      log_->flush();
      chunk_begun_.reset();
    }
  }
  if (time - last_sync_ >= options_.sync_period) {
    sync();
    std::error_code ignored;
    if (!std::filesystem::exists(path_, ignored)) {
      report_(Level::kWarning, kRecorder,
              path_.string() + " was removed or renamed; begins another file");
      finish_file();
      return;
    }
  }
  const bool is_old =
      options_.rotate_time != kForever && time - file_begun_ >= options_.rotate_time;
  if (is_old || sink_->size() >= rotate_size()) finish_file();
  remove_oldest();
}

void RecordingFiles::finish() {
  if (log_ == nullptr && unfinished_) open();
  if (log_ != nullptr) finish_file();
  remove_oldest();  // the end of a file has a size, too
}

void RecordingFiles::finish_file() {
  log_->finish();
  log_.reset();
  chunk_begun_.reset();
  sync();
  bytes_of_finished_ += sink_->size() - begun_at_;
  finished_.push_back({.path = path_, .stem = stem_, .part = part_, .size = sink_->size()});
  sink_.reset();
  path_.clear();
  ++part_;
}

void RecordingFiles::sync() {
  last_sync_ = now();
  if (sink_->size() == synced_size_) return;
  try {
    sink_->sync();
    synced_size_ = sink_->size();
  } catch (const SystemError& error) {
    // The data is safe as long as the machine runs. The next sync may succeed.
    report_(Level::kError, kRecorder, error.what());
  }
}

// Throws SystemError if the disk has less room than should stay free.
void RecordingFiles::require_room() {
  const Instant time = now();
  if (options_.keep_free == 0 || time - last_look_ < kLookPeriod) return;
  struct statvfs disk{};
  if (::statvfs(options_.folder.c_str(), &disk) == 0) {
    const std::uint64_t room = std::uint64_t{disk.f_bavail} * disk.f_frsize;
    if (room < options_.keep_free) {
      throw SystemError("leave " + size_text(options_.keep_free) + " free on the disk of " +
                            options_.folder.string(),
                        ENOSPC);
    }
  }
  last_look_ = time;
}

void RecordingFiles::remove_oldest() {
  if (options_.max_total == 0) return;
  std::uint64_t total = sink_ != nullptr ? sink_->size() : 0;
  for (const File& file : finished_) total += file.size;
  while (total > options_.max_total && !finished_.empty()) {
    const File& oldest = finished_.front();
    std::error_code error;
    std::filesystem::remove(oldest.path, error);
    report_(error ? Level::kError : Level::kInfo, kRecorder,
            error ? "cannot remove " + oldest.path.string() + ": " + error.message()
                  : "removed " + oldest.path.string() + " to stay below " +
                        size_text(options_.max_total));
    total -= std::min(total, oldest.size);
    finished_.pop_front();
  }
}

std::uint64_t RecordingFiles::rotate_size() const noexcept {
  return options_.max_total == 0 ? options_.rotate_size
                                 : std::min(options_.rotate_size, options_.max_total / 8);
}

std::filesystem::path RecordingFiles::path() const {
  return path_.empty() && !finished_.empty() ? finished_.back().path : path_;
}

std::uint64_t RecordingFiles::bytes() const noexcept {
  return bytes_of_finished_ + (sink_ != nullptr ? sink_->size() - begun_at_ : 0);
}

}  // namespace trifinger::log::detail
