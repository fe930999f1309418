// SPDX-License-Identifier: BSD-3-Clause
#include "ipc/file_lock.hpp"

#include <fcntl.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <system_error>
#include <thread>

#include "base/regular_file.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::ipc {
namespace {

struct flock request_of(short type, Lock lock) noexcept {
  struct flock request{};
  request.l_type = type;
  request.l_whence = SEEK_SET;
  request.l_start = static_cast<off_t>(lock);
  request.l_len = 1;
  return request;
}

bool try_to(const FileDescriptor& file, struct flock request) {
  if (::fcntl(file.get(), F_OFD_SETLK, &request) == 0) return true;
  if (errno == EAGAIN || errno == EACCES) return false;
  throw SystemError("lock a session file", errno);
}

// True if the open file holds the owner's lock. /proc describes it as "lock:\t1: OFDLCK ADVISORY
// WRITE -1 00:1a:4711 0 0".
bool is_owner(const std::filesystem::path& info) {
  std::ifstream file(info);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("lock:") || line.find(" OFDLCK ") == std::string::npos) continue;
    if (line.find(" WRITE ") != std::string::npos && line.ends_with(" 0 0")) return true;
  }
  return false;
}

// True if the process owns a file with one of these names.
bool is_owner(const std::filesystem::path& process, const std::array<std::string, 2>& names) {
  std::error_code error;
  std::filesystem::directory_iterator files(process / "fd", error);
  for (const std::filesystem::directory_iterator end; !error && files != end;
       files.increment(error)) {
    std::error_code gone;
    const std::string target = std::filesystem::read_symlink(files->path(), gone).string();
    if (gone || std::ranges::find(names, target) == names.end()) continue;
    if (is_owner(process / "fdinfo" / files->path().filename())) return true;
  }
  return false;
}

}  // namespace

bool try_lock(const FileDescriptor& file, Lock lock) {
  return try_to(file, request_of(F_WRLCK, lock));
}

bool try_share(const FileDescriptor& file, Lock lock) {
  return try_to(file, request_of(F_RDLCK, lock));
}

bool LockTimeout::wait(bool holder_is_ending) const {
  constexpr Nanoseconds kLook = std::chrono::milliseconds(5);
  // For a moment a kill is no longer pending, but has no other visible effect yet.
  constexpr Nanoseconds kDoubt = std::chrono::milliseconds(100);
  constexpr Nanoseconds kLongest = std::chrono::seconds(10);
  const Nanoseconds waited = std::chrono::steady_clock::now() - begin_;
  if (waited >= (holder_is_ending ? kLongest : kDoubt)) return false;
  std::this_thread::sleep_for(kLook);
  return true;
}

void unlock(const FileDescriptor& file, Lock lock) noexcept {
  struct flock request = request_of(F_UNLCK, lock);
  ::fcntl(file.get(), F_OFD_SETLK, &request);
}

bool is_named(const FileDescriptor& file, const std::filesystem::path& path) noexcept {
  struct stat open{};
  struct stat named{};
  return ::fstat(file.get(), &open) == 0 && ::lstat(path.c_str(), &named) == 0 &&
         named.st_ino == open.st_ino && named.st_dev == open.st_dev;
}

FileDescriptor open_lock_file(const std::filesystem::path& path) {
  return FileDescriptor([&path] {
    while (true) {
      try {
        return open_regular_file(path, O_RDWR, NamedBy::kProgram);
      } catch (const SystemError& error) {
        if (error.error_number() != ENOENT) throw;
      }
      try {
        // O_EXCL: where all users may write, the kernel lets nobody open the file of another user
        // with O_CREAT alone, not even the administrator (fs.protected_regular).
        return open_regular_file(path, O_RDWR | O_CREAT | O_EXCL, NamedBy::kProgram,
                                 S_IRUSR | S_IWUSR);
      } catch (const SystemError& error) {
        if (error.error_number() != EEXIST) throw;
      }
    }
  });
}

bool remove_lock_file(const FileDescriptor& file, const std::filesystem::path& path) noexcept {
  struct flock claim = request_of(F_WRLCK, Lock::kClaim);
  if (::fcntl(file.get(), F_OFD_SETLK, &claim) != 0) return false;
  if (is_named(file, path) && !is_locked_by_other(file, Lock::kOwner) &&
      !is_locked_by_other(file, Lock::kJob)) {
    ::unlink(path.c_str());
  }
  unlock(file, Lock::kClaim);
  return true;
}

void leave_lock_file(const FileDescriptor& file, const std::filesystem::path& path) noexcept {
  unlock(file, Lock::kOwner);
  unlock(file, Lock::kJob);
  // Two who leave at once would each keep the file for the other, so they do it one by one. A
  // process that arrives has the claim for longer, but then it owns the file and removes it.
  constexpr int kLooks = 500;
  for (int look = 0; look < kLooks && !remove_lock_file(file, path); ++look) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

bool is_owned(const std::filesystem::path& path) {
  struct stat status{};
  if (::lstat(path.c_str(), &status) != 0) return false;
  // "1: OFDLCK ADVISORY  WRITE -1 00:1a:4711 0 0": the inode comes last but two.
  std::string place = ":" + std::to_string(status.st_ino) + " 0 0";
  // Its device distinguishes it from files elsewhere with the same small number. Some other file
  // systems show another device here than to stat().
  struct statfs system{};
  if (::statfs(path.c_str(), &system) == 0 &&
      (system.f_type == TMPFS_MAGIC || system.f_type == EXT4_SUPER_MAGIC)) {
    std::array<char, 32> device{};
    std::snprintf(device.data(), device.size(), " %02x:%02x", ::major(status.st_dev),
                  ::minor(status.st_dev));
    place.insert(0, device.data());
  }
  std::ifstream locks("/proc/locks");
  if (!locks) return true;
  for (std::string line; std::getline(locks, line);) {
    if (line.find(" OFDLCK ") != std::string::npos && line.find(" WRITE ") != std::string::npos &&
        line.ends_with(place)) {
      return true;
    }
  }
  return false;
}

bool is_locked_by_other(const FileDescriptor& file, Lock lock) noexcept {
  struct flock request = request_of(F_WRLCK, lock);
  return ::fcntl(file.get(), F_OFD_GETLK, &request) == 0 && request.l_type != F_UNLCK;
}

std::vector<ProcessIdentity> owners_of(const std::filesystem::path& path) {
  std::error_code ignored;
  std::filesystem::path real = std::filesystem::canonical(path.parent_path(), ignored);
  if (ignored) return {};
  real /= path.filename();
  const std::array<std::string, 2> names{real.string(), real.string() + " (deleted)"};
  std::vector<ProcessIdentity> owners;
  std::error_code error;
  std::filesystem::directory_iterator processes("/proc", error);
  for (const std::filesystem::directory_iterator end; !error && processes != end;
       processes.increment(error)) {
    std::int64_t pid = 0;
    const std::string name = processes->path().filename().string();
    const auto [last, problem] = std::from_chars(name.data(), name.data() + name.size(), pid);
    if (problem != std::errc() || last != name.data() + name.size()) continue;
    // The identity is read before the look at the files. A process that reuses the number meanwhile
    // is then not taken for this one.
    const ProcessIdentity process = ProcessIdentity::of(pid);
    if (is_owner(processes->path(), names) && process.is_alive()) owners.push_back(process);
  }
  std::ranges::sort(owners, {}, &ProcessIdentity::start_time);
  return owners;
}

}  // namespace trifinger::ipc
