// SPDX-License-Identifier: BSD-3-Clause
#include "ipc/shared_memory.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <random>
#include <thread>
#include <utility>

#include "base/regular_file.hpp"
#include "bus_error_guard.hpp"
#include "ipc/file_lock.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::ipc {
namespace {

// How much room there is where the file lies, and how to get more.
std::string room_text(const FileDescriptor& file) {
  struct statvfs room{};
  if (::fstatvfs(file.get(), &room) != 0) return "";
  const auto megabytes = [&room](fsblkcnt_t count) {
    return std::to_string((count * room.f_frsize) >> 20U) + " MiB";
  };
  return ", where " + megabytes(room.f_bavail) + " of " + megabytes(room.f_blocks) +
         " are free (a container has 64 MiB unless it is started with '--shm-size=1g'; elsewhere "
         "'mount -o remount,size=50% /dev/shm' gives more)";
}

void allocate(const FileDescriptor& file, std::size_t size, const std::string& what) {
  // When a signal arrives, the kernel gives back what the call has allocated so far, and the call
  // begins again or fails. Small pieces finish even if signals arrive often.
  constexpr std::size_t kPiece = 256 * 1024;
  for (std::size_t done = 0; done < size;) {
    const std::size_t piece = std::min(kPiece, size - done);
    const int error =
        ::posix_fallocate(file.get(), static_cast<off_t>(done), static_cast<off_t>(piece));
    if (error == 0) {
      done += piece;
    } else if (error != EINTR) {
      throw SystemError("reserve " + std::to_string(size) + " bytes for " + what +
                            (error == ENOSPC ? room_text(file) : ""),
                        error);
    }
  }
}

int open_flags(Access access) { return access == Access::kReadOnly ? O_RDONLY : O_RDWR; }

// Nobody can guess this name, so nobody can have taken it before.
std::string hidden_name(const std::string& name) {
  std::random_device device;
  const std::uint64_t number = (std::uint64_t{device()} << 32U) | device();
  return "." + name + "." + std::to_string(number);
}

}  // namespace

SharedMemory SharedMemory::create_anonymous(std::size_t size) {
  SharedMemory memory;
  memory.file_ = FileDescriptor([] { return ::memfd_create("trifinger", MFD_CLOEXEC); });
  if (!memory.file_) throw SystemError("make anonymous shared memory", errno);
  allocate(memory.file_, size, "anonymous shared memory");
  memory.map(Access::kReadWrite);
  return memory;
}

SharedMemory SharedMemory::create_file(const std::filesystem::path& folder, const std::string& name,
                                       std::size_t size, unsigned mode) {
  SharedMemory memory;
  memory.path_ = folder / name;
  const std::filesystem::path hidden = folder / hidden_name(name);
  memory.file_ = FileDescriptor([&] {
    return open_regular_file(hidden, O_RDWR | O_CREAT | O_EXCL, NamedBy::kProgram,
                             S_IRUSR | S_IWUSR);
  });
  memory.hidden_path_ = hidden;
  allocate(memory.file_, size, memory.path_.string());
  memory.set_mode(mode);
  memory.map(Access::kReadWrite);
  return memory;
}

SharedMemory SharedMemory::open(const std::filesystem::path& path, Access access) {
  // A file that is being made anew has just lost its name, so the next attempt finds another file.
  constexpr int kLooks = 200;
  SharedMemory memory;
  memory.path_ = path;
  for (int i = 0; i < kLooks; ++i) {
    memory.file_ = FileDescriptor(
        [&] { return open_regular_file(path, open_flags(access), NamedBy::kProgram); });
    if (try_share(memory.file_, Lock::kUse)) {
      memory.map(access);
      return memory;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  throw SystemError("open " + path.string() + ", which another process has locked", EAGAIN);
}

SharedMemory SharedMemory::reopen(Access access) const {
  SharedMemory memory;
  memory.path_ = path_;
  // The link in /proc is the only name of anonymous memory. Opening it gives a new file
  // description.
  const std::string link = "/proc/self/fd/" + std::to_string(file_.get());
  memory.file_ =
      FileDescriptor([&] { return ::open(link.c_str(), open_flags(access) | O_CLOEXEC); });
  if (!memory.file_) throw SystemError("open shared memory once more", errno);
  if (!try_share(memory.file_, Lock::kUse)) {
    throw SystemError("open shared memory once more", EAGAIN);
  }
  memory.map(access);
  return memory;
}

SharedMemory::SharedMemory(SharedMemory&& other) noexcept { *this = std::move(other); }

SharedMemory& SharedMemory::operator=(SharedMemory&& other) noexcept {
  std::swap(file_, other.file_);
  std::swap(path_, other.path_);
  std::swap(hidden_path_, other.hidden_path_);
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  std::swap(guard_, other.guard_);
  std::swap(fork_, other.fork_);
  return *this;
}

SharedMemory::~SharedMemory() {
  unmap();
  // In a forked child the hidden name belongs to the parent.
  if (!hidden_path_.empty() && !fork_.is_inherited()) ::unlink(hidden_path_.c_str());
}

void SharedMemory::unmap() noexcept {
  if (guard_ >= 0) release_range(guard_);
  if (data_ != nullptr) ::munmap(data_, size_);
  guard_ = -1;
  data_ = nullptr;
}

void SharedMemory::retire() noexcept {
  unmap();
  unlock(file_, Lock::kOwner);
}

bool SharedMemory::make_anew(const std::string& name, unsigned mode) {
  // This lock is kept until the file is published. A process that has opened the old file and not
  // yet mapped it then looks again.
  if (!try_lock(file_, Lock::kUse)) return false;
  path_ = hidden_path_.parent_path() / name;
  struct stat status{};
  const bool is_whole = ::fstat(file_.get(), &status) == 0 &&
                        std::cmp_equal(status.st_size, size_) && is_named(file_, hidden_path_);
  if (is_whole) {
    allocate(file_, size_, path_.string());
    set_mode(mode);
    map(Access::kReadWrite);
    std::memset(data_, 0, size_);
    if (!is_damaged()) return true;
  }
  retire();
  unlock(file_, Lock::kUse);
  return false;
}

void SharedMemory::set_mode(unsigned mode) {
  // fchmod, not open: the mode must not depend on the umask.
  if (::fchmod(file_.get(), mode) != 0) {
    throw SystemError("set the mode of " + path_.string(), errno);
  }
}

void SharedMemory::publish() {
  unlock(file_, Lock::kUse);
  // The file keeps a hidden name, so that it can be made anew after another file has taken its
  // public name.
  const std::filesystem::path first = hidden_path_;
  const std::filesystem::path second = path_.parent_path() / hidden_name(path_.filename().string());
  if (::link(first.c_str(), second.c_str()) != 0) {
    throw SystemError("publish " + path_.string(), errno);
  }
  hidden_path_ = second;
  if (::rename(first.c_str(), path_.c_str()) != 0) {
    const int error = errno;
    ::unlink(first.c_str());
    try {
      // If the obstacle is a file of another kind or user, this says what it is.
      ::close(open_regular_file(path_, O_RDONLY, NamedBy::kProgram));
    } catch (const SystemError& found) {
      if (found.error_number() != ENOENT) throw;
    }
    throw SystemError("publish " + path_.string(), error);
  }
  // If both names already meant the same file, rename() has left the first name in place.
  ::unlink(first.c_str());
}

bool SharedMemory::publish_if_absent() {
  if (::renameat2(AT_FDCWD, hidden_path_.c_str(), AT_FDCWD, path_.c_str(), RENAME_NOREPLACE) != 0) {
    // ENOENT: who owns the public name removes hidden ones, which killed processes may have left.
    if (errno == EEXIST || errno == ENOENT) return false;
    throw SystemError("publish " + path_.string(), errno);
  }
  hidden_path_.clear();
  return true;
}

bool SharedMemory::is_damaged() const noexcept { return guard_ >= 0 && is_range_damaged(guard_); }

bool SharedMemory::has_name() const noexcept {
  if (path_.empty()) return true;
  return is_named(file_, path_);
}

void SharedMemory::map(Access access) {
  struct stat status{};
  if (::fstat(file_.get(), &status) != 0) throw SystemError("inspect " + path_.string(), errno);
  size_ = static_cast<std::size_t>(status.st_size);
  if (size_ == 0) return;  // there is nothing to map, and nothing that could be truncated

  const int protection = access == Access::kReadOnly ? PROT_READ : PROT_READ | PROT_WRITE;
  // MAP_POPULATE: the loop must not meet page faults.
  void* const address =
      ::mmap(nullptr, size_, protection, MAP_SHARED | MAP_POPULATE, file_.get(), 0);
  if (address == MAP_FAILED) {
    const int error = errno;
    size_ = 0;
    const std::string doing = "map " + (path_.empty() ? "shared memory" : path_.string());
    if (error != ENOMEM) throw SystemError(doing, error);
    throw SystemError(doing +
                          " (is there room, and are the mappings of this process fewer than "
                          "'sysctl vm.max_map_count' allows?)",
                      error);
  }
  data_ = static_cast<std::byte*>(address);
  guard_ = guard_range(data_, size_);
}

}  // namespace trifinger::ipc
