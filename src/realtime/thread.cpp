// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/realtime/thread.hpp"

#include <fcntl.h>
#include <linux/capability.h>
#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>

#include "realtime/limit_remedy.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger {
namespace {

// Why a setting was refused, and the remedy. Empty if the setting was granted.
using Refusal = std::optional<std::string>;

std::string message_of(int error) { return std::generic_category().message(error); }

Refusal set_priority(int priority) {
  const sched_param parameters{.sched_priority = priority};
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
  if (error == 0) return std::nullopt;
  return "no real-time priority " + std::to_string(priority) + ": " + message_of(error) +
         "; to allow it, " + remedy_for(RealtimeLimit::kPriority);
}

// Tries the next higher priority, too: a watchdog that cannot have it may never see that the loop
// hangs.
Refusal take_priority(int priority) {
  if (Refusal refusal = set_priority(priority)) return refusal;
  if (Refusal refusal = set_priority(priority + 1)) {
    return "its watchdog cannot have a higher priority than the loop: " + *refusal +
           ", or choose a lower priority";
  }
  return set_priority(priority);
}

cpu_set_t own_processors() noexcept {
  cpu_set_t own;
  CPU_ZERO(&own);
  ::sched_getaffinity(0, sizeof(own), &own);
  return own;
}

// The processors that this program was given: those of a thread before it stayed on one of them.
const cpu_set_t& given_processors() noexcept {
  static const cpu_set_t given = own_processors();
  return given;
}

void use_given_processors() noexcept {
  pthread_setaffinity_np(pthread_self(), sizeof(cpu_set_t), &given_processors());
}

// The processors that this process may use, for example "0 to 3, 6".
std::string allowed_processors() {
  const cpu_set_t allowed = own_processors();
  std::string text;
  for (std::size_t cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (!CPU_ISSET(cpu, &allowed)) continue;
    const std::size_t first = cpu;
    while (cpu + 1 < CPU_SETSIZE && CPU_ISSET(cpu + 1, &allowed)) ++cpu;
    text += (text.empty() ? "" : ", ") + std::to_string(first);
    if (cpu > first) text += " to " + std::to_string(cpu);
  }
  return text;
}

Refusal stay_on(int cpu) {
  static_cast<void>(given_processors());  // from now on this thread does not know them
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(cpu), &set);
  const int error = pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
  if (error == 0) return std::nullopt;
  return "cannot stay on processor " + std::to_string(cpu) + ": " + message_of(error) +
         "; this process may use " + allowed_processors();
}

bool has_capability(unsigned capability) {
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> data{};
  return ::syscall(SYS_capget, &header, data.data()) == 0 &&
         (data[CAP_TO_INDEX(capability)].effective & CAP_TO_MASK(capability)) != 0;
}

Refusal lock_memory() {
  const std::string remedy = "; to allow it, " + remedy_for(RealtimeLimit::kLockedMemory);
  rlimit limit{};
  ::getrlimit(RLIMIT_MEMLOCK, &limit);
  // A limit that suffices today may not suffice later. Then making threads and sessions would fail
  // in the middle of the work.
  if (limit.rlim_cur != RLIM_INFINITY && !has_capability(CAP_IPC_LOCK)) {
    return "memory is not locked: the limit is " + std::to_string(limit.rlim_cur >> 10U) + " KiB" +
           remedy;
  }
  if (::mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return std::nullopt;
  return "memory is not locked: " + message_of(errno) + remedy;
}

// Touches the part of the stack that the loop may use, so that it exists before the first deadline.
[[gnu::noinline]] void touch_stack() {
  constexpr std::size_t kStackUsed = 256 * 1024;
  unsigned char stack[kStackUsed];
  std::memset(stack, 1, sizeof(stack));
  // Keeps the compiler from removing the write, whose result nobody reads.
  asm volatile("" : : "r"(stack) : "memory");
}

// The loop allocates nothing, but between two sessions its thread does. These settings give it
// pages that were touched before: large blocks come from the heap like small ones, and the heap
// never shrinks.
void fill_heap(std::size_t size) {
  ::mallopt(M_TRIM_THRESHOLD, -1);
  ::mallopt(M_MMAP_MAX, 0);
  void* const block = std::malloc(size);
  if (block == nullptr) return;
  std::memset(block, 1, size);
  asm volatile("" : : "r"(block) : "memory");
  std::free(block);
}

// While this file is open, the kernel keeps every processor awake enough for the latency written to
// it. It is closed when its thread ends, and in forked children.
thread_local ipc::FileDescriptor awake_cpus;

Refusal keep_cpus_awake() {
  constexpr const char* kFile = "/dev/cpu_dma_latency";
  constexpr std::int32_t kLatency = 0;  // [us] that a processor may take to wake up
  ipc::FileDescriptor file([] { return ::open(kFile, O_WRONLY | O_CLOEXEC); });
  if (file && ::write(file.get(), &kLatency, sizeof(kLatency)) == sizeof(kLatency)) {
    awake_cpus = std::move(file);
    return std::nullopt;
  }
  const int error = errno;
  return std::string("processors may fall asleep: ") + kFile + ": " + message_of(error) +
         "; allow it with the udev rule KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", "
         "MODE=\"0660\"";
}

std::vector<std::string>& own_warnings() {
  thread_local std::vector<std::string> warnings{"no real-time settings were asked for"};
  return warnings;
}

}  // namespace

std::vector<std::string> enter_realtime(const RealtimeOptions& options) {
  std::vector<std::string> refused;
  if (options.demand == Demand::kOff) return refused;
  const auto note = [&refused](Refusal refusal) {
    if (refusal) refused.push_back(*std::move(refusal));
  };
  note(take_priority(options.priority));
  if (options.cpu) note(stay_on(*options.cpu));
  if (options.lock_memory) note(lock_memory());
  if (options.keep_cpus_awake) note(keep_cpus_awake());
  if (options.heap > 0) fill_heap(options.heap);
  touch_stack();

  if (options.demand == Demand::kRequire && !refused.empty()) {
    std::string text = "the machine refuses what real time requires";
    for (const std::string& sentence : refused) text += "\n  " + sentence;
    throw Error(text);
  }
  own_warnings() = refused;
  return refused;
}

std::vector<std::string> realtime_warnings() { return own_warnings(); }

void leave_realtime() noexcept {
  int policy = SCHED_OTHER;
  sched_param parameters{};
  if (pthread_getschedparam(pthread_self(), &policy, &parameters) != 0 ||
      (policy != SCHED_FIFO && policy != SCHED_RR)) {
    return;
  }
  parameters.sched_priority = 0;
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &parameters);
  use_given_processors();
}

void outrank_realtime() noexcept {
  int policy = SCHED_OTHER;
  sched_param parameters{};
  if (pthread_getschedparam(pthread_self(), &policy, &parameters) != 0 || policy != SCHED_FIFO) {
    return;
  }
  constexpr int kHighestPriority = 99;
  parameters.sched_priority = std::min(parameters.sched_priority + 1, kHighestPriority);
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
  use_given_processors();
}

}  // namespace trifinger
