// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/file_descriptor.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <set>

#include "ipc/forkable_mutex.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::ipc {
namespace {

constexpr int kNothing = O_PATH | O_CLOEXEC;

// The registry is never destroyed: destructors that run at exit may still close descriptors.
struct Registry {
  std::mutex mutex;
  std::set<int> descriptors;
  std::atomic<std::uint64_t> generation{0};
  // Locked before `mutex`: who holds one of these mutexes may open and close files.
  std::mutex forkable_mutex;
  std::set<ForkableMutex*> forkable;

  // In a forked child: numbers of the parent's descriptors.
  std::set<int> inherited;

  // Closes all files in a forked child. Their numbers stay taken by what can neither be read nor
  // written, so an inherited handle never reaches a later file that got its number.
  void let_go() {
    int nothing = ::open("/", kNothing);
    for (const int fd : descriptors) {
      if (nothing < 0) {
        // There is no free number, so this one is freed for it.
        ::close(fd);
        nothing = ::open("/", kNothing);
      }
      if (nothing >= 0 && (nothing == fd || ::dup3(nothing, fd, O_CLOEXEC) == fd)) {
        inherited.insert(fd);
      } else {
        ::close(fd);
      }
    }
    descriptors.clear();
    if (nothing >= 0 && !inherited.contains(nothing)) ::close(nothing);
  }

  void close(int fd) {
    const std::lock_guard lock(mutex);
    // Somebody may have closed all files of a child, so that the number belongs to another one.
    const bool is_own = descriptors.erase(fd) > 0;
    if (is_own || (inherited.erase(fd) > 0 && (::fcntl(fd, F_GETFL) & O_PATH) != 0)) ::close(fd);
  }

  void prepare_fork() {
    forkable_mutex.lock();
    for (ForkableMutex* const each : forkable) each->lock();
    mutex.lock();
  }
  void end_fork() {
    mutex.unlock();
    for (ForkableMutex* const each : forkable) each->unlock();
    forkable_mutex.unlock();
  }
};

Registry& registry() {
  static Registry* const instance = [] {
    auto* made = new Registry;
    pthread_atfork([] { registry().prepare_fork(); }, [] { registry().end_fork(); },
                   [] {
                     registry().let_go();
                     // relaxed: a forked child has one thread.
                     registry().generation.fetch_add(1, std::memory_order_relaxed);
                     registry().end_fork();
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

ForkableMutex::ForkableMutex() {
  const std::lock_guard lock(registry().forkable_mutex);
  registry().forkable.insert(this);
}

ForkableMutex::~ForkableMutex() {
  const std::lock_guard lock(registry().forkable_mutex);
  registry().forkable.erase(this);
}

FileDescriptor::FileDescriptor(const std::function<int()>& open) : fd_(open_registered(open)) {}

FileDescriptor::~FileDescriptor() {
  if (fd_ < 0) return;
  registry().close(fd_);
}

}  // namespace trifinger::ipc
