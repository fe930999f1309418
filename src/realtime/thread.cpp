// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/realtime/thread.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

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

}  // namespace trifinger
