// SPDX-License-Identifier: BSD-3-Clause
#include "bus_error_guard.hpp"

#include <signal.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::ipc {
namespace {

// A signal handler reads this, so there is no lock. An entry is in use while `end` is not zero.
struct Entry {
  std::atomic<bool> taken{false};
  std::atomic<std::uintptr_t> begin{0};
  std::atomic<std::uintptr_t> end{0};
  std::atomic<bool> damaged{false};
};

// Blocks are made on demand and never released. Together they hold more entries than the kernel's
// default limit of mappings in a process (vm.max_map_count).
constexpr std::size_t kBlockSize = 1024;
constexpr std::size_t kMaxBlocks = 1024;
using Block = std::array<Entry, kBlockSize>;
std::array<std::atomic<Block*>, kMaxBlocks> blocks;
struct sigaction previous_action;
std::uintptr_t page_size;

// Returns the entry in use whose range contains this address, or nullptr.
Entry* find(std::uintptr_t address) noexcept {
  for (const std::atomic<Block*>& place : blocks) {
    // acquire: the block was made before.
    Block* const block = place.load(std::memory_order_acquire);
    if (block == nullptr) break;
    for (Entry& entry : *block) {
      // acquire: pairs with the release in guard_range, so `begin` is valid if `end` is not zero.
      const std::uintptr_t end = entry.end.load(std::memory_order_acquire);
      if (address < end && address >= entry.begin.load(std::memory_order_relaxed)) return &entry;
    }
  }
  return nullptr;
}

Entry& entry_at(int index) noexcept {
  const auto i = static_cast<std::size_t>(index);
  // acquire: the block was made before, perhaps by another thread.
  return (*blocks[i / kBlockSize].load(std::memory_order_acquire))[i % kBlockSize];
}

// Returns the block at this place and makes it if it does not exist.
Block& block_at(std::atomic<Block*>& place) {
  // acquire: the block was made before.
  Block* block = place.load(std::memory_order_acquire);
  if (block != nullptr) return *block;
  auto made = std::make_unique<Block>();
  // acq_rel: whoever sees the block sees it complete, whether this or another thread made it.
  if (place.compare_exchange_strong(block, made.get(), std::memory_order_acq_rel)) {
    block = made.release();
  }
  return *block;
}

void on_bus_error(int signal, siginfo_t* info, void* context) {
  const auto address = reinterpret_cast<std::uintptr_t>(info->si_addr);
  if (Entry* const entry = find(address)) {
    void* const page = reinterpret_cast<void*>(address & ~(page_size - 1));
    // A system call instead of mmap(): ThreadSanitizer takes mmap() for a write of this thread to
    // the whole page.
    if (::syscall(SYS_mmap, page, page_size, PROT_READ | PROT_WRITE,
                  MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) != -1) {
      // relaxed: no other data depends on this flag.
      entry->damaged.store(true, std::memory_order_relaxed);
      return;
    }
  }

  if ((previous_action.sa_flags & SA_SIGINFO) != 0 && previous_action.sa_sigaction != nullptr) {
    previous_action.sa_sigaction(signal, info, context);
  } else if (previous_action.sa_handler != SIG_DFL && previous_action.sa_handler != SIG_IGN) {
    previous_action.sa_handler(signal);
  } else {
    // The instruction runs again after the return, and then ends the process in the usual way.
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
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    Block& block = block_at(blocks[b]);
    for (std::size_t i = 0; i < block.size(); ++i) {
      Entry& entry = block[i];
      // relaxed: this look only avoids an unnecessary write to a taken entry.
      if (entry.taken.load(std::memory_order_relaxed)) continue;
      // acquire: the stores of the previous owner are complete.
      if (entry.taken.exchange(true, std::memory_order_acquire)) continue;
      entry.damaged.store(false, std::memory_order_relaxed);
      entry.begin.store(reinterpret_cast<std::uintptr_t>(data), std::memory_order_relaxed);
      // release: the handler that sees `end` sees the stores above.
      entry.end.store(reinterpret_cast<std::uintptr_t>(data) + size, std::memory_order_release);
      return static_cast<int>(b * kBlockSize + i);
    }
  }
  throw Error("more than " + std::to_string(kMaxBlocks * kBlockSize) +
              " mapped session files in one process");
}

void release_range(int entry) noexcept {
  Entry& released = entry_at(entry);
  released.end.store(0, std::memory_order_relaxed);
  // release: the next owner of the entry sees it empty.
  released.taken.store(false, std::memory_order_release);
}

bool is_range_damaged(int entry) noexcept {
  return entry_at(entry).damaged.load(std::memory_order_relaxed);
}

}  // namespace trifinger::ipc
