// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/shared_memory.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <random>
#include <utility>

#include "bus_error_guard.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/regular_file.hpp"

namespace trifinger::ipc {
namespace {

void allocate(const FileDescriptor& file, std::size_t size, const std::string& what) {
  // A signal makes the kernel give back what a call has taken so far, and begin again or fail. In
  // small pieces this comes to an end however often one arrives.
  constexpr std::size_t kPiece = 256 * 1024;
  for (std::size_t done = 0; done < size;) {
    const std::size_t piece = std::min(kPiece, size - done);
    const int error =
        ::posix_fallocate(file.get(), static_cast<off_t>(done), static_cast<off_t>(piece));
    if (error == 0) {
      done += piece;
    } else if (error != EINTR) {
      throw SystemError("reserve " + std::to_string(size) + " bytes for " + what, error);
    }
  }
}

int open_flags(Access access) { return access == Access::kReadOnly ? O_RDONLY : O_RDWR; }

// Nobody can guess it, and so nobody has taken it before.
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
  memory.temporary_path_ = hidden;
  allocate(memory.file_, size, memory.path_.string());
  // fchmod, not open: the mode asked for must not depend on the umask.
  if (::fchmod(memory.file_.get(), mode) != 0) {
    throw SystemError("set the mode of " + memory.path_.string(), errno);
  }
  memory.map(Access::kReadWrite);
  return memory;
}

SharedMemory SharedMemory::open(const std::filesystem::path& path, Access access) {
  SharedMemory memory;
  memory.path_ = path;
  memory.file_ = FileDescriptor(
      [&] { return open_regular_file(path, open_flags(access), NamedBy::kProgram); });
  memory.map(access);
  return memory;
}

SharedMemory SharedMemory::reopen(Access access) const {
  SharedMemory memory;
  memory.path_ = path_;
  // The link in /proc is the only other name of anonymous memory; it opens a new file description.
  const std::string link = "/proc/self/fd/" + std::to_string(file_.get());
  memory.file_ =
      FileDescriptor([&] { return ::open(link.c_str(), open_flags(access) | O_CLOEXEC); });
  if (!memory.file_) throw SystemError("open shared memory once more", errno);
  memory.map(access);
  return memory;
}

SharedMemory::SharedMemory(SharedMemory&& other) noexcept { *this = std::move(other); }

SharedMemory& SharedMemory::operator=(SharedMemory&& other) noexcept {
  std::swap(file_, other.file_);
  std::swap(path_, other.path_);
  std::swap(temporary_path_, other.temporary_path_);
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  std::swap(guard_, other.guard_);
  return *this;
}

SharedMemory::~SharedMemory() {
  if (guard_ >= 0) release_range(guard_);
  if (data_ != nullptr) ::munmap(data_, size_);
  if (!temporary_path_.empty()) ::unlink(temporary_path_.c_str());
}

void SharedMemory::publish() {
  if (::rename(temporary_path_.c_str(), path_.c_str()) != 0) {
    const int error = errno;
    try {
      // Says what is in the way if that is no file of ours.
      ::close(open_regular_file(path_, O_RDONLY, NamedBy::kProgram));
    } catch (const SystemError& found) {
      if (found.error_number() != ENOENT) throw;
    }
    throw SystemError("publish " + path_.string(), error);
  }
  temporary_path_.clear();
}

bool SharedMemory::publish_if_absent() {
  if (::renameat2(AT_FDCWD, temporary_path_.c_str(), AT_FDCWD, path_.c_str(), RENAME_NOREPLACE) !=
      0) {
    if (errno == EEXIST) return false;
    throw SystemError("publish " + path_.string(), errno);
  }
  temporary_path_.clear();
  return true;
}

bool SharedMemory::is_damaged() const noexcept { return guard_ >= 0 && is_range_damaged(guard_); }

bool SharedMemory::has_name() const noexcept {
  struct stat status{};
  return ::fstat(file_.get(), &status) == 0 && status.st_nlink > 0;
}

void SharedMemory::map(Access access) {
  struct stat status{};
  if (::fstat(file_.get(), &status) != 0) throw SystemError("inspect " + path_.string(), errno);
  size_ = static_cast<std::size_t>(status.st_size);
  if (size_ == 0) return;  // there is nothing to map, and nothing to be cut off

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
