// SPDX-License-Identifier: BSD-3-Clause
#include "write/recording_files.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <utility>

#include "format/dates.hpp"
#include "format/format.hpp"
#include "trifinger/base/regular_file.hpp"
#include "trifinger/ipc/file_lock.hpp"
#include "trifinger/ipc/process.hpp"
#include "trifinger/log/message_layout.hpp"
#include "trifinger/mcap/reader.hpp"
#include "write/random_id.hpp"

namespace trifinger::log {
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

std::string size_text(std::uint64_t bytes) {
  constexpr std::array<const char*, 5> kUnits{"bytes", "kB", "MB", "GB", "TB"};
  auto size = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (size >= 999.5 && unit + 1 < kUnits.size()) {
    size /= 1000.0;
    ++unit;
  }
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g %s", size, kUnits[unit]);
  return text.data();
}

std::string file_name(const std::string& stem, int part) {
  std::array<char, 16> number{};
  std::snprintf(number.data(), number.size(), "_%03d", part);
  return stem + number.data() + std::string(kLogSuffix);
}

std::string joined(const std::vector<std::string>& robots) {
  std::string name;
  for (const std::string& robot : robots) name += (name.empty() ? "" : "+") + robot;
  if (name.size() > kMaxName) {
    throw InvalidArgument("the names of " + std::to_string(robots.size()) +
                          " robots are too long for that of a file: record fewer into one");
  }
  return name;
}

std::string entry(const std::map<std::string, std::string>& entries, const std::string& key) {
  const auto found = entries.find(key);
  return found == entries.end() ? std::string() : found->second;
}

// Returns what the file says about itself under `key`.
std::string log_entry(const mcap::Contents& contents, const std::string& key) {
  for (const mcap::Metadata& record : contents.metadata) {
    if (record.name == "trifinger.log") return entry(record.entries, key);
  }
  return {};
}

TimeIndex index_of(std::string_view text) noexcept {
  TimeIndex index = 0;
  std::from_chars(text.data(), text.data() + text.size(), index);
  return index;
}

std::vector<std::string> words(std::string_view text) {
  std::vector<std::string> found;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(' '));
    found.emplace_back(word);
    text.remove_prefix(std::min(text.size(), word.size() + 1));
  }
  return found;
}

// Finds, in one file, the position up to which a session was recorded.
class PositionSearch {
 public:
  PositionSearch(mcap::Reader& reader, std::string robot, std::uint64_t session_id)
      : reader_(reader), robot_(std::move(robot)), session_id_(session_id) {}

  std::optional<Position> run() {
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
    return entry(record.entries, "session_id") == std::to_string(session_id_);
  }

  bool read_metadata() {
    const mcap::Contents& contents = reader_.contents();
    bool is_known = false;
    for (std::size_t i = 0; i < contents.metadata.size(); ++i) {
      const mcap::Metadata& record = contents.metadata[i];
      if (!is_ours(record)) continue;
      const std::string name = entry(record.entries, "name");
      if (record.name == "trifinger.session" && name == robot_) {
        is_known = true;
        begin_ = contents.metadata_places[i].offset;
        position_.time_offset = index_of(entry(record.entries, "time_offset"));
        reach(name, index_of(entry(record.entries, "first_index")));
        const auto companions = words(entry(record.entries, "companions"));
        const auto first = words(entry(record.entries, "companion_first_indices"));
        for (std::size_t k = 0; k < companions.size(); ++k) {
          reach(companions[k], k < first.size() ? index_of(first[k]) : 0);
        }
      }
      if (record.name == "trifinger.gap") reach(name, index_of(entry(record.entries, "last")) + 1);
      if (record.name == "trifinger.end" && name == robot_) position_.is_closed = true;
    }
    // Only channels that have messages need a search.
    for (const auto& [id, channel] : contents.channels) {
      const auto count = contents.channel_message_counts.find(id);
      if (count == contents.channel_message_counts.end() || count->second == 0) continue;
      const std::string role = entry(channel.metadata, "role");
      if ((role == "step" || role == "companion") &&
          is_session_of_robot(entry(channel.metadata, "session"))) {
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
    const std::string name = entry(metadata, "session");
    const std::string role = entry(metadata, "role");
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
  Position position_;
};

// Says who holds a lock, as stored in the lock's file. Messages and waiting processes use it;
// everything else works without it.
struct LockOwner {
  ipc::ProcessIdentity recorder;
  ipc::ProcessIdentity robot;  // the recorder ends with this process, if there is one

  static LockOwner read(const ipc::FileDescriptor& file) noexcept {
    LockOwner owner;
    if (::pread(file.get(), &owner, sizeof(owner), 0) != sizeof(owner)) return {};
    return owner;
  }
  void write(const ipc::FileDescriptor& file) const noexcept {
    static_cast<void>(::pwrite(file.get(), this, sizeof(*this), 0));
  }
  [[nodiscard]] bool is_known() const noexcept { return recorder.pid != 0; }
  [[nodiscard]] bool is_finishing() const noexcept {
    return (robot.pid != 0 && robot.is_ending()) || (is_known() && recorder.is_ending());
  }
};

[[noreturn]] void throw_recorded(const std::filesystem::path& folder, const std::string& robot,
                                 const LockOwner& owner) {
  throw AlreadyRecorded("robot '" + robot + "' is recorded into " + folder.string() + " by " +
                        (owner.is_known() ? ipc::describe(owner.recorder) : "another process") +
                        "; choose another folder, or stop that one");
}

[[noreturn]] void throw_unfinished(const std::filesystem::path& folder, const std::string& robot,
                                   const LockOwner& owner) {
  throw AlreadyRecorded(
      "robot '" + robot + "' is recorded into " + folder.string() + " by " +
      ipc::describe(owner.recorder) +
      ", whose back-end is gone and which does not finish; choose another folder, or end it with "
      "'kill -9 " +
      std::to_string(owner.recorder.pid) + "'");
}

std::unique_ptr<mcap::Sink> open_file(const std::filesystem::path& path,
                                      std::optional<std::uint64_t> size) {
  return std::make_unique<mcap::FileSink>(size ? mcap::FileSink::resume(path, *size)
                                               : mcap::FileSink::create(path));
}

}  // namespace

// --- RecordingLock ---

RecordingLock::RecordingLock(const std::filesystem::path& folder, const std::string& robot,
                             const std::optional<ipc::ProcessIdentity>& robot_process)
    : path_(folder / ("." + robot + ".recorder")) {
  constexpr mode_t kMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;
  const ipc::LockPatience patience;
  while (true) {
    file_ = ipc::FileDescriptor(
        [this] { return open_regular_file(path_, O_RDWR | O_CREAT, NamedBy::kProgram, kMode); });
    if (!ipc::try_lock(file_)) {
      const LockOwner owner = LockOwner::read(file_);
      if (patience.wait(owner.is_finishing())) continue;
      if (owner.is_finishing()) throw_unfinished(folder, robot, owner);
      throw_recorded(folder, robot, owner);
    }
    // The previous owner may have removed the file between our two calls.
    struct stat ours{};
    struct stat named{};
    if (::fstat(file_.get(), &ours) == 0 && ::lstat(path_.c_str(), &named) == 0 &&
        ours.st_ino == named.st_ino && ours.st_dev == named.st_dev) {
      break;
    }
  }
  LockOwner{ipc::ProcessIdentity::of_this_process(), robot_process.value_or(ipc::ProcessIdentity{})}
      .write(file_);
}

RecordingLock::~RecordingLock() {
  // The lock is still held here, so the file that is removed is ours.
  if (file_) ::unlink(path_.c_str());
}

// --- RecordingFiles ---

RecordingFiles::RecordingFiles(const std::vector<std::string>& robots,
                               const RecorderOptions& options, Tell tell)
    : options_(options), tell_(std::move(tell)), name_(joined(robots)) {
  std::error_code error;
  std::filesystem::create_directories(options_.folder, error);
  if (error) throw SystemError("make the folder " + options_.folder.string(), error.value());
  for (const std::string& robot : robots) {
    locks_.emplace_back(options_.folder, robot, options_.until_process_ends);
  }
  look_at(find_files());
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
void RecordingFiles::look_at(std::vector<File> files) {
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
      tell_(Level::kWarning, kRecorder, file.path.string() + " cannot be read: " + error.what());
    }
  }
  id_ = random_id();
  auto begin = std::chrono::system_clock::now();
  const auto is_taken = [this](const File& file) { return file.stem == stem_; };
  do {
    stem_ = name_ + "_" + date_text(begin);
    begin += std::chrono::seconds(1);
  } while (std::ranges::any_of(earlier_, is_taken));
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
    if (entry(record.entries, "name") != robot) continue;
    std::uint64_t id = 0;
    const std::string text = entry(record.entries, "session_id");
    std::from_chars(text.data(), text.data() + text.size(), id);
    if (record.name == "trifinger.session") open.push_back(id);
    if (record.name == "trifinger.end") std::erase(open, id);
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

std::optional<Position> RecordingFiles::find(const std::string& robot,
                                             std::uint64_t session_id) const {
  std::size_t searched = 0;
  for (const File& file : earlier_) {
    if (++searched > kMaxFilesToSearch) break;
    try {
      if (unfinished_ && unfinished_->file.path == file.path) {
        auto position = PositionSearch(*unfinished_->reader, robot, session_id).run();
        if (!position) continue;
        position->file = file.path;
        return position;
      }
      mcap::Reader reader(file.path);
      auto position = PositionSearch(reader, robot, session_id).run();
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
      tell_(Level::kWarning, kRecorder,
            "cannot go on with " + unfinished.file.path.string() + ": " + error.what() +
                "; begins another file");
      ++part_;
    }
  }
  open_new();
}

void RecordingFiles::open_new() {
  const RecorderOptions::OpenFile open = options_.open_file ? options_.open_file : open_file;
  std::unique_ptr<mcap::Sink> sink;
  std::filesystem::path path;
  while (sink == nullptr) {
    path = options_.folder / file_name(stem_, part_);
    try {
      sink = open(path, std::nullopt);
    } catch (const SystemError& error) {
      if (error.error_number() != EEXIST) throw;
      ++part_;
    }
  }
  try {
    log_ = std::make_unique<LogWriter>(*sink, LogOptions{.precision = options_.precision,
                                                         .compression = options_.compression,
                                                         .level = options_.level,
                                                         .recording = id_,
                                                         .part = part_});
  } catch (...) {
    // No byte was written, so the next attempt creates the file again.
    sink.reset();
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    throw;
  }
  sink_ = std::move(sink);
  path_ = std::move(path);
  begun_at_ = 0;
  file_begun_ = last_sync_ = now();
  synced_size_ = 0;
  tell_(Level::kInfo, kRecorder, "records into " + path_.string());
}

void RecordingFiles::go_on(const Unfinished& unfinished) {
  const RecorderOptions::OpenFile open = options_.open_file ? options_.open_file : open_file;
  const mcap::Contents& contents = unfinished.reader->contents();
  std::unique_ptr<mcap::Sink> sink = open(unfinished.file.path, contents.complete_size);
  log_ = std::make_unique<LogWriter>(*sink,
                                     LogOptions{.precision = options_.precision,
                                                .compression = options_.compression,
                                                .level = options_.level,
                                                .recording = id_,
                                                .part = part_},
                                     contents);
  sink_ = std::move(sink);
  path_ = unfinished.file.path;
  begun_at_ = contents.complete_size;
  file_begun_ = last_sync_ = now();
  synced_size_ = 0;
  std::string text = "goes on with " + path_.string() + ", which another recorder has left";
  if (unfinished.file.size > contents.complete_size) {
    text += "; " + std::to_string(unfinished.file.size - contents.complete_size) +
            " bytes at its end were half written";
  }
  tell_(Level::kWarning, kRecorder, text);
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
      tell_(Level::kWarning, kRecorder,
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
    tell_(Level::kError, kRecorder, error.what());
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
    tell_(error ? Level::kError : Level::kInfo, kRecorder,
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

}  // namespace trifinger::log
