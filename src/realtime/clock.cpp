// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/realtime/clock.hpp"

#include <pthread.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <new>

#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

timespec to_timespec(Instant instant) noexcept {
  const auto since_epoch = instant.time_since_epoch();
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since_epoch);
  return {.tv_sec = seconds.count(), .tv_nsec = (since_epoch - seconds).count()};
}

}  // namespace

Instant MonotonicClock::now() const noexcept { return std::chrono::steady_clock::now(); }

void MonotonicClock::sleep_until(Instant deadline) noexcept {
  const timespec end = to_timespec(deadline);
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &end, nullptr) == EINTR) {
  }
}

Nanoseconds MonotonicClock::suspended_time() const noexcept {
  // CLOCK_BOOTTIME, which includes suspension, is read first. A thread that is interrupted between
  // the two reads gets too small a value, and the rest at its next call.
  timespec with_suspension{};
  ::clock_gettime(CLOCK_BOOTTIME, &with_suspension);
  return std::chrono::seconds(with_suspension.tv_sec) + Nanoseconds(with_suspension.tv_nsec) -
         now().time_since_epoch();
}

MonotonicClock& MonotonicClock::instance() noexcept {
  static MonotonicClock clock;
  return clock;
}

struct ManualClock::State {
  pthread_mutex_t mutex;
  pthread_cond_t changed;
  Instant now;
  Nanoseconds suspended{0};
  Instant earliest_deadline{Instant::max()};  // that of the one sleeper
  bool free{false};

  class Lock {
   public:
    explicit Lock(State& state) : state_(state) { pthread_mutex_lock(&state.mutex); }
    ~Lock() { pthread_mutex_unlock(&state_.mutex); }
    Lock(const Lock&) = delete;
    Lock& operator=(const Lock&) = delete;

   private:
    State& state_;
  };
};

ManualClock::ManualClock(Instant start) {
  void* const memory =
      ::mmap(nullptr, sizeof(State), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw SystemError("map a manual clock", errno);
  state_ = new (memory) State{};
  state_->now = start;

  pthread_mutexattr_t mutex_attributes;
  pthread_mutexattr_init(&mutex_attributes);
  pthread_mutexattr_setpshared(&mutex_attributes, PTHREAD_PROCESS_SHARED);
  pthread_mutex_init(&state_->mutex, &mutex_attributes);
  pthread_condattr_t condition_attributes;
  pthread_condattr_init(&condition_attributes);
  pthread_condattr_setpshared(&condition_attributes, PTHREAD_PROCESS_SHARED);
  pthread_condattr_setclock(&condition_attributes, CLOCK_MONOTONIC);
  pthread_cond_init(&state_->changed, &condition_attributes);
}

// The mutex and the condition are left as they are: a forked child may still use them.
ManualClock::~ManualClock() { ::munmap(state_, sizeof(State)); }

Instant ManualClock::now() const noexcept {
  const State::Lock lock(*state_);
  return state_->now;
}

void ManualClock::sleep_until(Instant deadline) noexcept {
  const State::Lock lock(*state_);
  state_->earliest_deadline = deadline;
  pthread_cond_broadcast(&state_->changed);
  while (state_->now < deadline && !state_->free) {
    pthread_cond_wait(&state_->changed, &state_->mutex);
  }
  state_->now = std::max(state_->now, deadline);
  state_->earliest_deadline = Instant::max();
}

Nanoseconds ManualClock::suspended_time() const noexcept {
  const State::Lock lock(*state_);
  return state_->suspended;
}

void ManualClock::suspend(Nanoseconds time) {
  const State::Lock lock(*state_);
  state_->suspended += time;
}

void ManualClock::advance(Nanoseconds step) {
  const State::Lock lock(*state_);
  state_->now += step;
  pthread_cond_broadcast(&state_->changed);
}

void ManualClock::wait_for_sleeper(Timeout timeout) {
  const timespec end = to_timespec(std::chrono::steady_clock::now() + timeout);
  const State::Lock lock(*state_);
  const auto somebody_sleeps = [this] {
    return state_->earliest_deadline != Instant::max() && state_->earliest_deadline > state_->now;
  };
  while (!somebody_sleeps()) {
    if (pthread_cond_timedwait(&state_->changed, &state_->mutex, &end) == ETIMEDOUT) {
      throw TimedOut("nobody sleeps on the manual clock");
    }
  }
}

void ManualClock::tick(Nanoseconds period, int count) {
  for (int i = 0; i < count; ++i) {
    wait_for_sleeper();
    advance(period);
  }
  wait_for_sleeper();
}

void ManualClock::run_free() {
  const State::Lock lock(*state_);
  state_->free = true;
  pthread_cond_broadcast(&state_->changed);
}

}  // namespace trifinger
