// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/file_descriptor.hpp"

#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <set>

#include "trifinger/ipc/fork.hpp"

namespace trifinger::ipc {
namespace {

// The registry is never destroyed: destructors that run at exit may still close descriptors.
struct Registry {
  std::mutex mutex;
  std::set<int> descriptors;
  std::atomic<std::uint64_t> generation{0};
};

Registry& registry() {
  static Registry* const instance = [] {
    auto* made = new Registry;
    pthread_atfork([] { registry().mutex.lock(); }, [] { registry().mutex.unlock(); },
                   [] {
                     for (const int fd : registry().descriptors) ::close(fd);
                     registry().descriptors.clear();
                     // relaxed: a forked child has one thread.
                     registry().generation.fetch_add(1, std::memory_order_relaxed);
                     registry().mutex.unlock();
                   });
    return made;
  }();
  return *instance;
}

int open_registered(const std::function<int()>& open) {
  const std::lock_guard lock(registry().mutex);
  const int fd = open();
  if (fd >= 0) registry().descriptors.insert(fd);
  return fd;
}

}  // namespace

std::uint64_t fork_generation() noexcept {
  // relaxed: the value changes only inside fork().
  return registry().generation.load(std::memory_order_relaxed);
}

FileDescriptor::FileDescriptor(const std::function<int()>& open) : fd_(open_registered(open)) {}

FileDescriptor::~FileDescriptor() {
  if (fd_ < 0) return;
  const std::lock_guard lock(registry().mutex);
  // In a forked child this number may now belong to another file.
  if (registry().descriptors.erase(fd_) > 0) ::close(fd_);
}

}  // namespace trifinger::ipc
