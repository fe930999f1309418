// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <functional>
#include <string>
#include <utility>

#include "base/regular_file.hpp"
#include "ipc/file_lock.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::mcap {
namespace {

ipc::FileDescriptor open_locked(const std::filesystem::path& path, int flags) {
  constexpr mode_t kMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP | S_IROTH | S_IWOTH;  // and umask
  ipc::FileDescriptor file(
      [&] { return open_regular_file(path, flags, NamedBy::kProgram, kMode); });
  if (!ipc::try_lock(file)) {
    throw InvalidArgument("another process is writing " + path.string());
  }
  return file;
}

// Syncs the folder: otherwise a loss of power could remove the name of a file whose bytes are safe.
void sync_folder_of(const std::filesystem::path& path) {
  const std::filesystem::path parent = path.has_parent_path() ? path.parent_path() : ".";
  const ipc::FileDescriptor folder(
      [&] { return ::open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); });
  // Some file systems cannot do that, and some folders may be written but not read.
  if (folder) static_cast<void>(::fsync(folder.get()));
}

int retry(const std::function<int()>& call) {
  int result = 0;
  do {
    result = call();
  } while (result < 0 && errno == EINTR);
  return result;
}

void cut(const ipc::FileDescriptor& file, std::uint64_t size) {
  if (retry([&] { return ::ftruncate(file.get(), static_cast<off_t>(size)); }) != 0) {
    throw SystemError("cut a log at byte " + std::to_string(size), errno);
  }
}

}  // namespace

FileSink::FileSink(ipc::FileDescriptor file, std::uint64_t size) noexcept
    : file_(std::move(file)), size_(size) {}

FileSink FileSink::create(const std::filesystem::path& path) {
  FileSink sink(open_locked(path, O_RDWR | O_CREAT | O_EXCL), 0);
  sync_folder_of(path);
  return sink;
}

FileSink FileSink::resume(const std::filesystem::path& path, std::uint64_t size) {
  ipc::FileDescriptor file = open_locked(path, O_RDWR);
  struct stat status{};
  if (::fstat(file.get(), &status) != 0) throw SystemError("inspect " + path.string(), errno);
  if (std::cmp_less(status.st_size, size)) {
    throw InvalidArgument(path.string() + " has " + std::to_string(status.st_size) +
                          " bytes; it cannot go on at byte " + std::to_string(size));
  }
  cut(file, size);
  return {std::move(file), size};
}

void FileSink::append(std::span<const std::byte> bytes) {
  // Writes at an explicit offset, so that the next attempt overwrites what a failed one has
  // written, even if that could not be cut off.
  std::uint64_t end = size_;
  while (!bytes.empty()) {
    const ssize_t written =
        ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(end));
    if (written > 0) {
      end += static_cast<std::uint64_t>(written);
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    } else if (written == 0 || errno != EINTR) {
      const int error = written == 0 ? ENOSPC : errno;
      retry([&] { return ::ftruncate(file_.get(), static_cast<off_t>(size_)); });
      throw SystemError("write to a log", error);
    }
  }
  size_ = end;
}

void FileSink::sync() {
  if (retry([&] { return ::fdatasync(file_.get()); }) != 0) {
    throw SystemError("make a log survive a loss of power", errno);
  }
}

}  // namespace trifinger::mcap
