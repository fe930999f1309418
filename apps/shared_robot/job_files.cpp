// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_files.hpp"

#include <fmt/core.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <cstddef>
#include <cstdio>
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

// Calls `use(path, status)` for each entry of `folder`, without following links.
template <class Use>
void for_each_file(const fs::path& folder, const Use& use) {
  std::error_code ignored;
  for (fs::directory_iterator entry(folder, ignored), end; entry != end; entry.increment(ignored)) {
    struct stat status{};
    if (::lstat(entry->path().c_str(), &status) == 0) use(entry->path(), status);
    if (ignored) break;
  }
}

// Calls `use(status)` for each file that the process has open.
template <class Use>
void for_each_open(pid_t pid, const Use& use) {
  std::error_code ignored;
  const fs::path folder = fmt::format("/proc/{}/fd", pid);
  for (fs::directory_iterator entry(folder, ignored), end; entry != end; entry.increment(ignored)) {
    struct stat status{};
    if (::stat(entry->path().c_str(), &status) == 0 && S_ISREG(status.st_mode)) use(status);
    if (ignored) break;
  }
}

// Calls `use(identity)` for each file that the process has mapped.
template <class Use>
void for_each_mapped(pid_t pid, const Use& use) {
  // For example "7f0-7f1 rw-s 00000000 00:1b 1234   /dev/shm/name": device and inode are the
  // fourth and the fifth word.
  std::istringstream maps(proc_text(pid, "maps"));
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

}  // namespace

JobFiles::JobFiles(fs::path folder, std::vector<fs::path> shared, uid_t user)
    : folder_(std::move(folder)), shared_(std::move(shared)), user_(user) {
  for (const fs::path& place : shared_) {
    for_each_file(place, [this](const fs::path& /*path*/, const struct stat& status) {
      before_.insert(identity_of(status));
    });
  }
}

void JobFiles::look_at(const std::vector<ProcessEntry>& processes) {
  std::set<std::uint64_t> shared_devices;
  for (const fs::path& place : shared_) {
    struct stat status{};
    if (::stat(place.c_str(), &status) == 0) shared_devices.insert(status.st_dev);
  }
  const auto note = [&](const FileIdentity& file) {
    // A bound keeps a hostile job from filling our memory.
    constexpr std::size_t kMostNoted = 100'000;
    if (shared_devices.contains(file.first) && !before_.contains(file) &&
        seen_.size() < kMostNoted) {
      seen_.insert(file);
    }
  };
  removed_.clear();
  removed_bytes_ = 0;
  for (const ProcessEntry& process : processes) {
    for_each_mapped(process.pid, note);
    for_each_open(process.pid, [&](const struct stat& status) {
      note(identity_of(status));
      const bool is_ours = status.st_nlink == 0 && status.st_uid == user_;
      if (is_ours && removed_.insert(identity_of(status)).second) {
        removed_bytes_ += bytes_of(status);
      }
    });
  }
}

template <class Use>
void JobFiles::for_each_new(const Use& use) const {
  for (const fs::path& place : shared_) {
    for_each_file(place, [&](const fs::path& path, const struct stat& status) {
      const FileIdentity file = identity_of(status);
      const bool is_new = status.st_uid == user_ && !before_.contains(file);
      if (is_new && (user_ != ::geteuid() || seen_.contains(file))) use(path, status);
    });
  }
}

FilesUsage JobFiles::usage(FilesUsage most) const {
  FilesUsage sum{.bytes = removed_bytes_, .count = removed_.size()};
  const auto is_enough = [&] { return sum.bytes > most.bytes || sum.count > most.count; };
  std::vector<fs::path> folders{folder_};
  while (!folders.empty() && !is_enough()) {
    const fs::path folder = std::move(folders.back());
    folders.pop_back();
    for_each_file(folder, [&](const fs::path& path, const struct stat& status) {
      if (is_enough()) return;
      ++sum.count;
      sum.bytes += bytes_of(status);
      if (S_ISDIR(status.st_mode)) folders.push_back(path);
    });
  }
  for_each_new([&](const fs::path& path, const struct stat& status) {
    // The session of a robot belongs to its back-end, not to the job.
    if (path.filename().string().starts_with("trifinger.")) return;
    ++sum.count;
    sum.bytes += bytes_of(status);
  });
  return sum;
}

std::vector<std::string> JobFiles::remove_leftovers() const {
  std::set<FileIdentity> in_use;
  for (const ProcessEntry& process : all_processes()) {
    for_each_mapped(process.pid, [&](const FileIdentity& file) { in_use.insert(file); });
    for_each_open(process.pid,
                  [&](const struct stat& status) { in_use.insert(identity_of(status)); });
  }
  std::vector<std::string> removed;
  for_each_new([&](const fs::path& path, const struct stat& status) {
    if (in_use.contains(identity_of(status))) return;
    std::error_code error;
    if (fs::remove_all(path, error) > 0 && !error) removed.push_back(path.string());
  });
  return removed;
}

}  // namespace trifinger::apps
