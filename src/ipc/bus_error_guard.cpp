// SPDX-License-Identifier: BSD-3-Clause
#include "bus_error_guard.hpp"

#include <signal.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>

#include "trifinger/base/error.hpp"

namespace trifinger::ipc {
namespace {

// Read by a signal handler, so no lock: an entry is in use while `end` is not zero.
struct Entry {
  std::atomic<bool> taken{false};
  std::atomic<std::uintptr_t> begin{0};
  std::atomic<std::uintptr_t> end{0};
  std::atomic<bool> damaged{false};
};

constexpr std::size_t kMaxRanges = 4096;
std::array<Entry, kMaxRanges> entries;
struct sigaction previous_action;
std::uintptr_t page_size;

void on_bus_error(int signal, siginfo_t* info, void* context) {
  const auto address = reinterpret_cast<std::uintptr_t>(info->si_addr);
  for (Entry& entry : entries) {
    // acquire: pairs with the release in guard_range, begin is valid once end is.
    const std::uintptr_t end = entry.end.load(std::memory_order_acquire);
    if (end == 0 || address >= end || address < entry.begin.load(std::memory_order_relaxed)) {
      continue;
    }
    void* const page = reinterpret_cast<void*>(address & ~(page_size - 1));
    // Not by mmap(): to ThreadSanitizer that is a write of this thread to the whole page.
    if (::syscall(SYS_mmap, page, page_size, PROT_READ | PROT_WRITE,
                  MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) == -1) {
      break;
    }
    // relaxed: a flag without data behind it.
    entry.damaged.store(true, std::memory_order_relaxed);
    return;
  }

  if ((previous_action.sa_flags & SA_SIGINFO) != 0 && previous_action.sa_sigaction != nullptr) {
    previous_action.sa_sigaction(signal, info, context);
  } else if (previous_action.sa_handler != SIG_DFL && previous_action.sa_handler != SIG_IGN) {
    previous_action.sa_handler(signal);
  } else {
    // The instruction runs again after the return and ends the process the ordinary way.
    ::signal(SIGBUS, SIG_DFL);
  }
}

void install_handler() {
  static std::once_flag once;
  std::call_once(once, [] {
    page_size = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
    struct sigaction action{};
    action.sa_sigaction = on_bus_error;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK;
    ::sigemptyset(&action.sa_mask);
    ::sigaction(SIGBUS, &action, &previous_action);
  });
}

}  // namespace

int guard_range(std::byte* data, std::size_t size) {
  install_handler();
  for (std::size_t i = 0; i < entries.size(); ++i) {
    Entry& entry = entries[i];
    // acquire: the previous owner's stores are done.
    if (entry.taken.exchange(true, std::memory_order_acquire)) continue;
    entry.damaged.store(false, std::memory_order_relaxed);
    entry.begin.store(reinterpret_cast<std::uintptr_t>(data), std::memory_order_relaxed);
    // release: the handler that sees `end` sees the stores above.
    entry.end.store(reinterpret_cast<std::uintptr_t>(data) + size, std::memory_order_release);
    return static_cast<int>(i);
  }
  throw Error("more than " + std::to_string(kMaxRanges) + " mapped session files in one process");
}

void release_range(int entry) noexcept {
  Entry& released = entries[static_cast<std::size_t>(entry)];
  released.end.store(0, std::memory_order_relaxed);
  // release: whoever takes the entry next sees it empty.
  released.taken.store(false, std::memory_order_release);
}

bool is_range_damaged(int entry) noexcept {
  return entries[static_cast<std::size_t>(entry)].damaged.load(std::memory_order_relaxed);
}

}  // namespace trifinger::ipc
