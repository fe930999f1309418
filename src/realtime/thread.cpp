// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/realtime/thread.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

std::string because(int error) { return ": " + std::generic_category().message(error); }

// Touches the part of the stack that the loop may use, so that it is there before the first
// deadline.
[[gnu::noinline]] void touch_stack() {
  constexpr std::size_t kStackUsed = 256 * 1024;
  unsigned char stack[kStackUsed];
  std::memset(stack, 1, sizeof(stack));
  // Keeps the compiler from leaving out what nobody reads.
  asm volatile("" : : "r"(stack) : "memory");
}

}  // namespace

std::vector<std::string> enter_realtime(const RealtimeOptions& options) {
  std::vector<std::string> refused;
  if (options.demand == Demand::kOff) return refused;

  const sched_param parameters{.sched_priority = options.priority};
  if (const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
      error != 0) {
    refused.push_back("no real-time priority " + std::to_string(options.priority) + because(error) +
                      "; allow it with 'rtprio 99' in /etc/security/limits.conf");
  }
  if (options.cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<std::size_t>(*options.cpu), &set);
    if (const int error = pthread_setaffinity_np(pthread_self(), sizeof(set), &set); error != 0) {
      refused.push_back("cannot stay on processor " + std::to_string(*options.cpu) +
                        because(error));
    }
  }
  if (options.lock_memory && ::mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    refused.push_back("memory is not locked" + because(errno) +
                      "; allow it with 'memlock unlimited' in /etc/security/limits.conf");
  }
  touch_stack();

  if (options.demand == Demand::kRequire && !refused.empty()) {
    std::string text = "the machine refuses what real time requires";
    for (const std::string& sentence : refused) text += "\n  " + sentence;
    throw Error(text);
  }
  return refused;
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
  cpu_set_t everywhere;
  CPU_ZERO(&everywhere);
  // The kernel leaves out those that are not there or not allowed.
  for (std::size_t cpu = 0; cpu < CPU_SETSIZE; ++cpu) CPU_SET(cpu, &everywhere);
  pthread_setaffinity_np(pthread_self(), sizeof(everywhere), &everywhere);
}

}  // namespace trifinger
