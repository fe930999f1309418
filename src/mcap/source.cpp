// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/regular_file.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/mcap/reader.hpp"

namespace trifinger::mcap {
namespace {

// Never maps the file: if a mapped file gets shorter, SIGBUS ends the process.
//
// The descriptor is no ipc::FileDescriptor, which forked children close: a worker of a data loader
// reads the logs that its parent has opened. It has no locks, and pread() shares no position.
class FileSource final : public Source {
 public:
  explicit FileSource(const std::filesystem::path& path)
      : file_(open_regular_file(path, O_RDONLY, NamedBy::kUser)), path_(path) {}
  FileSource(const FileSource&) = delete;
  FileSource& operator=(const FileSource&) = delete;
  ~FileSource() override { ::close(file_); }

  [[nodiscard]] std::size_t read(std::uint64_t offset, std::span<std::byte> bytes) const override {
    return read_at(file_, offset, bytes, path_);
  }

  [[nodiscard]] std::uint64_t size() const override {
    return static_cast<std::uint64_t>(status().st_size);
  }

 private:
  [[nodiscard]] struct stat status() const {
    struct stat status{};
    if (::fstat(file_, &status) != 0) throw SystemError("inspect " + path_.string(), errno);
    return status;
  }

  int file_;
  std::filesystem::path path_;
};

class MemorySource final : public Source {
 public:
  explicit MemorySource(std::span<const std::byte> bytes) noexcept : bytes_(bytes) {}

  [[nodiscard]] std::size_t read(std::uint64_t offset, std::span<std::byte> bytes) const override {
    const auto rest = bytes_.subspan(std::min<std::uint64_t>(offset, bytes_.size()));
    const std::size_t count = std::min(rest.size(), bytes.size());
    std::copy_n(rest.begin(), count, bytes.begin());
    return count;
  }
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }

 private:
  std::span<const std::byte> bytes_;
};

}  // namespace

std::unique_ptr<Source> open_file(const std::filesystem::path& path) {
  return std::make_unique<FileSource>(path);
}

std::unique_ptr<Source> open_memory(std::span<const std::byte> bytes) {
  return std::make_unique<MemorySource>(bytes);
}

}  // namespace trifinger::mcap
