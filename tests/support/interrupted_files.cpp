// SPDX-License-Identifier: BSD-3-Clause
#include "support/interrupted_files.hpp"

#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>

namespace {

constexpr std::size_t kPart = 1000;  // [bytes] that one call moves at most

std::atomic<bool> is_slow{false};
std::atomic<std::int64_t> calls{0};

// Every other call is interrupted.
bool is_interrupted() noexcept {
  if (!is_slow.load() || calls.fetch_add(1) % 2 != 0) return false;
  errno = EINTR;
  return true;
}

std::size_t part_of(std::size_t size) noexcept {
  return is_slow.load() ? std::min(size, kPart) : size;
}

}  // namespace

// Replaces the functions of the C library, under their names.
extern "C" {

ssize_t pread(int fd, void* buf, std::size_t nbytes, off_t offset) {
  if (is_interrupted()) return -1;
  return ::syscall(SYS_pread64, fd, buf, part_of(nbytes), offset);
}

ssize_t pwrite(int fd, const void* buf, std::size_t n, off_t offset) {
  if (is_interrupted()) return -1;
  return ::syscall(SYS_pwrite64, fd, buf, part_of(n), offset);
}

int ftruncate(int fd, off_t length) noexcept {
  if (is_interrupted()) return -1;
  return static_cast<int>(::syscall(SYS_ftruncate, fd, length));
}

int fdatasync(int fildes) {
  if (is_interrupted()) return -1;
  return static_cast<int>(::syscall(SYS_fdatasync, fildes));
}
}

namespace trifinger::test {

InterruptedFiles::InterruptedFiles() noexcept {
  calls = 0;
  is_slow = true;
}

InterruptedFiles::~InterruptedFiles() { is_slow = false; }

std::int64_t InterruptedFiles::count() noexcept { return (calls.load() + 1) / 2; }

}  // namespace trifinger::test
