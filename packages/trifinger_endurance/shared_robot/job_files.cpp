// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_files.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <sstream>
#include <string_view>
#include <system_error>

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

// Size of a block in `struct stat`, whatever the file system has.
constexpr std::uint64_t kBlock = 512;

FileIdentity identity_of(const struct stat& status) { return {status.st_dev, status.st_ino}; }

std::uint64_t bytes_of(const struct stat& status) {
  return kBlock * static_cast<std::uint64_t>(status.st_blocks);
}

// Something in a folder.
struct Entry {
  int folder;  // open
  const fs::path& folder_path;
  const char* name;
  const struct stat& status;

  [[nodiscard]] fs::path path() const { return folder_path / name; }
};

// Goes through everything in a folder and in the folders in it, without following links. Names of
// any length are no obstacle, because each step is one from a folder that is open.
struct Walk {
  // False ends the walk.
  std::function<bool(const Entry&)> see;
  // What was in this folder has been seen.
  std::function<void(const Entry&)> leave = [](const Entry&) {};
  // This folder, or something in it, cannot be looked at.
  std::function<void(const struct stat&)> miss = [](const struct stat&) {};

  // Looks into `name` in the open folder `parent`; AT_FDCWD if it is a path.
  bool through(int parent, const char* name, const fs::path& path, int depth = 0) const;
};

bool Walk::through(int parent, const char* name, const fs::path& path, int depth) const {
  // Deeper ones would need too many open files. Nobody has them who does not want to hide
  // something.
  constexpr int kMaxDepth = 200;
  struct stat folder{};
  if (::fstatat(parent, name, &folder, AT_SYMLINK_NOFOLLOW) != 0) return true;
  const auto close = [](DIR* open) { ::closedir(open); };
  std::unique_ptr<DIR, decltype(close)> stream;
  if (depth < kMaxDepth) {
    const int file = ::openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (file < 0 && errno == ENOENT) return true;  // It has just been removed.
    if (file >= 0) stream.reset(::fdopendir(file));
  }
  if (!stream) {
    miss(folder);
    return true;
  }
  while (const dirent* const found = ::readdir(stream.get())) {
    const std::string_view text = found->d_name;
    if (text == "." || text == "..") continue;
    struct stat status{};
    const int file = ::dirfd(stream.get());
    if (::fstatat(file, found->d_name, &status, AT_SYMLINK_NOFOLLOW) != 0) {
      if (errno != ENOENT) miss(folder);
      continue;
    }
    const Entry entry{.folder = file, .folder_path = path, .name = found->d_name, .status = status};
    if (!see(entry)) return false;
    if (!S_ISDIR(status.st_mode)) continue;
    if (!through(file, found->d_name, path / found->d_name, depth + 1)) return false;
    leave(entry);
  }
  return true;
}

bool go_through(const fs::path& folder, const Walk& walk) {
  return walk.through(AT_FDCWD, folder.c_str(), folder);
}

// Calls `use(status)` for each file that a thread of the process has open.
template <class Use>
void for_each_open(pid_t pid, const Use& use) {
  for_each_thread(pid, [&use](const fs::path& thread) {
    std::error_code ignored;
    for (fs::directory_iterator entry(thread / "fd", ignored), end; entry != end && !ignored;
         entry.increment(ignored)) {
      struct stat status{};
      if (::stat(entry->path().c_str(), &status) == 0 && S_ISREG(status.st_mode)) use(status);
    }
  });
}

constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

// Calls `use(identity)` for each file that the process has mapped. Reads at most so many bytes.
template <class Use>
void for_each_mapped(const ProcessEntry& process, const Use& use, std::size_t most = kAll) {
  // For example "7f0-7f1 rw-s 00000000 00:1b 1234   /dev/shm/name": device and inode are the
  // fourth and the fifth word.
  std::istringstream maps(proc_text(process.live_thread, "maps", most));
  for (std::string line; std::getline(maps, line);) {
    std::istringstream words(line);
    std::string skipped;
    unsigned major = 0;
    unsigned minor = 0;
    char colon = 0;
    ino_t inode = 0;
    words >> skipped >> skipped >> skipped >> std::hex >> major >> colon >> minor >> std::dec >>
        inode;
    if (words && colon == ':' && inode != 0) use(FileIdentity{::makedev(major, minor), inode});
  }
}

// A file of a session of a robot.
bool is_session(const Entry& entry, const std::vector<fs::path>& shared) {
  return std::string_view(entry.name).starts_with("trifinger.") &&
         std::ranges::find(shared, entry.folder_path) != shared.end();
}

}  // namespace

JobFiles::JobFiles(fs::path folder, std::vector<fs::path> shared, uid_t user)
    : path_(std::move(folder)),
      folder_([this] { return ::open(path_.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC); }),
      shared_(std::move(shared)),
      user_(user) {
  // What lies in another place is seen there.
  for (const fs::path& place : shared_) {
    const auto holds = [&](const fs::path& other) {
      return other != place && std::ranges::mismatch(other, place).in1 == other.end();
    };
    if (std::ranges::none_of(shared_, holds)) roots_.push_back(place);
  }
  for (const fs::path& place : roots_) {
    go_through(place, {.see = [this](const Entry& entry) {
                 before_.insert(identity_of(entry.status));
                 return true;
               }});
  }
}

bool JobFiles::is_new(const struct stat& status) const {
  return status.st_uid == user_ && !before_.contains(identity_of(status));
}

void JobFiles::look_at(const std::vector<ProcessEntry>& processes) {
  std::set<std::uint64_t> shared_devices;
  for (const fs::path& place : shared_) {
    struct stat status{};
    if (::stat(place.c_str(), &status) == 0) shared_devices.insert(status.st_dev);
  }
  const auto note = [&](const FileIdentity& file) {
    // A bound keeps a hostile job from filling our memory.
    constexpr std::size_t kMaxNotes = 100'000;
    if (shared_devices.contains(file.first) && !before_.contains(file) &&
        seen_.size() < kMaxNotes) {
      seen_.insert(file);
    }
  };
  find_sessions_of_others(processes);
  removed_.clear();
  removed_bytes_ = 0;
  for (const ProcessEntry& process : processes) {
    // A process may have 65530 of them, and there may be hundreds of processes.
    constexpr std::size_t kMaxRead = 1'000'000;
    for_each_mapped(process, note, kMaxRead);
    for_each_open(process.pid, [&](const struct stat& status) {
      note(identity_of(status));
      const bool is_ours = status.st_nlink == 0 && status.st_uid == user_;
      if (is_ours && removed_.insert(identity_of(status)).second) {
        removed_bytes_ += bytes_of(status);
      }
    });
  }
}

void JobFiles::find_sessions_of_others(const std::vector<ProcessEntry>& job) {
  std::set<FileIdentity> unknown;
  for (const fs::path& place : roots_) {
    go_through(place, {.see = [&](const Entry& entry) {
                 const FileIdentity file = identity_of(entry.status);
                 if (is_session(entry, shared_) && is_new(entry.status) &&
                     !sessions_of_others_.contains(file)) {
                   unknown.insert(file);
                 }
                 return true;
               }});
  }
  if (unknown.empty()) return;
  const auto note = [&](const FileIdentity& file) {
    if (unknown.contains(file)) sessions_of_others_.insert(file);
  };
  for (const ProcessEntry& process : all_processes()) {
    if (std::ranges::find(job, process.pid, &ProcessEntry::pid) != job.end()) continue;
    for_each_mapped(process, note);
    for_each_open(process.pid, [&](const struct stat& status) { note(identity_of(status)); });
  }
}

FilesUsage JobFiles::usage(FilesUsage most) const {
  FilesUsage sum{.bytes = removed_bytes_, .count = removed_.size()};
  const auto add = [&](const struct stat& status) {
    ++sum.count;
    sum.bytes += bytes_of(status);
    return sum.bytes <= most.bytes && sum.count <= most.count;
  };
  const Walk own{.see = [&](const Entry& entry) { return add(entry.status); },
                 .miss = [&](const struct stat&) { sum.is_hidden = true; }};
  // Wherever the folder is now.
  bool goes_on = own.through(folder_.get(), ".", path_);
  for (const fs::path& place : roots_) {
    if (!goes_on) break;
    goes_on = go_through(place, {.see =
                                     [&](const Entry& entry) {
                                       const bool counts =
                                           is_new(entry.status) &&
                                           !sessions_of_others_.contains(identity_of(entry.status));
                                       return !counts || add(entry.status);
                                     },
                                 .miss =
                                     [&](const struct stat& folder) {
                                       if (is_new(folder)) sum.is_hidden = true;
                                     }});
  }
  return sum;
}

std::vector<std::string> JobFiles::remove_leftovers() const {
  std::set<FileIdentity> in_use;
  for (const ProcessEntry& process : all_processes()) {
    for_each_mapped(process, [&](const FileIdentity& file) { in_use.insert(file); });
    for_each_open(process.pid,
                  [&](const struct stat& status) { in_use.insert(identity_of(status)); });
  }
  const bool is_of_others = user_ != ::geteuid();
  std::vector<std::string> removed;
  const auto remove = [&](const Entry& entry, int flags) {
    if (::unlinkat(entry.folder, entry.name, flags) == 0) removed.push_back(entry.path().string());
  };
  for (const fs::path& place : roots_) {
    go_through(place, {.see =
                           [&](const Entry& entry) {
                             const FileIdentity file = identity_of(entry.status);
                             const bool may_go = is_new(entry.status) && !in_use.contains(file) &&
                                                 (is_of_others || seen_.contains(file));
                             if (may_go && !S_ISDIR(entry.status.st_mode)) remove(entry, 0);
                             return true;
                           },
                       .leave =
                           [&](const Entry& entry) {
                             const bool had_leftovers =
                                 !removed.empty() &&
                                 removed.back().starts_with(entry.path().string() + "/");
                             if (is_new(entry.status) && (is_of_others || had_leftovers))
                               remove(entry, AT_REMOVEDIR);
                           }});
  }
  return removed;
}

}  // namespace trifinger::apps
