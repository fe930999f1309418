// SPDX-License-Identifier: BSD-3-Clause
#include "support/changed_clocks.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <ctime>

namespace {

std::atomic<std::int64_t> wall_ahead{0};  // [s]
std::atomic<std::int64_t> suspended{0};   // [s]

}  // namespace

// Replaces the function of the C library.
extern "C" int clock_gettime(clockid_t clock_id, timespec* tp) noexcept {
  if (::syscall(SYS_clock_gettime, clock_id, tp) != 0) return -1;
  if (clock_id == CLOCK_REALTIME) tp->tv_sec += wall_ahead.load();
  if (clock_id == CLOCK_BOOTTIME) tp->tv_sec += suspended.load();
  return 0;
}

namespace trifinger::test {

ChangedClocks::~ChangedClocks() {
  wall_ahead = 0;
  suspended = 0;
}

void ChangedClocks::set_wall_ahead(std::chrono::seconds ahead) noexcept {
  wall_ahead = ahead.count();
}

void ChangedClocks::set_suspended(std::chrono::seconds time) noexcept { suspended = time.count(); }

bool ChangedClocks::work() noexcept {
  const auto before = std::chrono::system_clock::now();
  const std::int64_t ahead = wall_ahead.exchange(86'400);
  const auto after = std::chrono::system_clock::now();
  wall_ahead = ahead;
  return after - before > std::chrono::hours(12);
}

}  // namespace trifinger::test
