// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/backend.hpp"

#include <signal.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "followers.hpp"
#include "ipc/futex.hpp"
#include "loop.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "session_place.hpp"
#include "session_writer.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger {
namespace {

constexpr Nanoseconds kWatchPeriod = std::chrono::milliseconds(20);
constexpr Nanoseconds kWaitSlice = std::chrono::milliseconds(50);

// A running session: its memory and its loop.
struct Run {
  Run(UntypedDriver& driver, detail::SessionPlace& place, const BackendOptions& options,
      const std::atomic<bool>& stop_requested, const Clock& clock)
      : writers(place.begin(driver, options.mode == BackendOptions::Mode::kRealTime, options.period,
                            realtime_warnings())),
        loop(driver, writers, options, stop_requested, clock) {}

  detail::SessionPlace::Writers writers;
  detail::Loop loop;
};

// Blocks signals in threads that are made while it lives. Signal handlers belong to the program and
// run in its own threads. Signals that a thread raises by its own fault still reach it.
class BlockedSignals {
 public:
  BlockedSignals() {
    sigset_t blocked;
    ::sigfillset(&blocked);
    for (const int own : {SIGBUS, SIGSEGV, SIGFPE, SIGILL, SIGTRAP, SIGABRT}) {
      ::sigdelset(&blocked, own);
    }
    ::pthread_sigmask(SIG_BLOCK, &blocked, &before_);
  }
  BlockedSignals(const BlockedSignals&) = delete;
  BlockedSignals& operator=(const BlockedSignals&) = delete;
  ~BlockedSignals() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

 private:
  sigset_t before_{};
};

// Checks two things that the loop cannot see: whether the controlling process lives, and whether
// each call of the driver returns.
class Watchdog {
 public:
  Watchdog(Run& run, Timeout driver_timeout) : run_(run), driver_timeout_(driver_timeout) {
    const BlockedSignals blocked;
    thread_ = std::thread([this] { watch(); });
  }
  ~Watchdog() {
    {
      const std::lock_guard lock(mutex_);
      done_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }

 private:
  void watch() {
    outrank_realtime();
    std::unique_lock lock(mutex_);
    while (!changed_.wait_for(lock, kWatchPeriod, [this] { return done_; })) {
      if (run_.writers.robot->controller_died()) {
        run_.loop.note_controller_died();
        ipc::futex_wake_all(run_.writers.robot->action_header().event);
      }
      if (driver_hangs() && !was_cut_) {
        was_cut_ = true;
        run_.loop.cut();
      }
    }
  }

  [[nodiscard]] bool driver_hangs() noexcept {
    if (driver_timeout_ == kForever) return false;
    const Instant now = std::chrono::steady_clock::now();
    // A long gap between two looks counts only in part: if this process was stopped, the driver was
    // stopped, too.
    call_time_ += std::min<Nanoseconds>(now - last_look_, 3 * kWatchPeriod);
    last_look_ = now;
    const std::uint64_t calls = run_.loop.driver_calls();
    if (calls != seen_calls_ || calls % 2 == 0) {
      seen_calls_ = calls;
      call_time_ = Nanoseconds::zero();
    }
    return call_time_ > driver_timeout_;
  }

  Run& run_;
  Timeout driver_timeout_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool done_{false};
  bool was_cut_{false};
  std::uint64_t seen_calls_{0};
  Nanoseconds call_time_{0};  // how long that call has been seen to last
  Instant last_look_{std::chrono::steady_clock::now()};
  std::thread thread_;
};

}  // namespace

void BackendOptions::validate() const {
  using detail::require;
  // Instants that lie some periods ahead must not overflow.
  require(
      period > Nanoseconds::zero() && period <= std::chrono::hours(1),
      "period is " + std::to_string(period.count()) + " ns; allowed are positive times up to 1 h");
  require(first_action_timeout > Nanoseconds::zero(), "first_action_timeout must be positive");
  require(driver_timeout > Nanoseconds::zero(), "driver_timeout must be positive");
  require(!late_after || *late_after >= Nanoseconds::zero(), "late_after must not be negative");
  require(max_measurement_age >= Nanoseconds::zero(), "max_measurement_age must not be negative");
  require(max_follower_wait >= Nanoseconds::zero(), "max_follower_wait must not be negative");
  require(max_stop_time >= Nanoseconds::zero(), "max_stop_time must not be negative");
}

class Backend::Implementation {
 public:
  Implementation(UntypedDriver& driver, SessionHost& host, const BackendOptions& options,
                 Clock& clock)
      : driver_(driver),
        host_(host),
        options_(options),
        clock_(clock),
        followers_(options.max_follower_wait) {
    options_.validate();
    try {
      // This throws if the host was moved from.
      static_cast<void>(host.open());
    } catch (const SessionNotFound&) {
      // There is none yet.
    }
    host.place().set_backend_life(life_);
  }

  ~Implementation() {
    if (!run_ || fork_.is_inherited()) return;
    request_stop();
    // A manual clock may not move any more, so this stop does not wait for the clock.
    while (step() != Progress::kEnded) {
    }
  }

  void follow(Follower& follower) { followers_.add(follower); }

  void run() {
    while (!stop_requested() && begin_when_there_is_memory()) {
      {
        const Watchdog watchdog(*run_, is_real_time() ? options_.driver_timeout : kForever);
        if (is_real_time()) {
          run_with_deadlines();
        } else {
          run_without_deadlines();
        }
      }
      last_fault_ = run_->loop.fault();
      if (after_session_) after_session_(last_fault_);
      if (last_fault_.needs_recovery()) wait_for_recovery();
    }
    run_.reset();
  }

  void set_after_session(std::function<void(const Fault&)> function) {
    after_session_ = std::move(function);
  }
  void set_on_waiting(std::function<void(const std::string&)> function) {
    on_waiting_ = std::move(function);
  }

  // relaxed: no other data depends on this flag.
  void request_stop() noexcept { stop_requested_.store(true, std::memory_order_relaxed); }

  void begin_session() {
    if (run_ && !run_->loop.fault()) return;
    come_to_rest();
    if (run_ && last_fault_.needs_recovery() && !was_recovered()) {
      const Session session = host_.open();
      throw RobotStopped(last_fault_, "robot '" + session.info().name +
                                          "' has stopped: " + session.mapping()->fault_text() +
                                          "; clear this with recover() when it is safe");
    }
    begin();
    // This brings the driver to where it holds, so that the session can be observed.
    while (advance() == Progress::kStepped) {
    }
  }

  Progress advance() noexcept {
    if (!run_) return Progress::kEnded;
    const Progress progress = step();
    if (progress == Progress::kEnded && !has_ended_) {
      has_ended_ = true;
      last_fault_ = run_->loop.fault();
    }
    return progress;
  }

  void recover() noexcept {
    come_to_rest();
    last_fault_ = {};
  }

  [[nodiscard]] const SessionHost& host() const noexcept { return host_; }
  [[nodiscard]] const BackendOptions& options() const noexcept { return options_; }

 private:
  [[nodiscard]] bool is_real_time() const noexcept {
    return options_.mode == BackendOptions::Mode::kRealTime;
  }
  [[nodiscard]] bool stop_requested() const noexcept {
    return stop_requested_.load(std::memory_order_relaxed);
  }

  // Inline: completes the orderly stop of a session that has ended. Its front-end may not have
  // completed it.
  void come_to_rest() noexcept {
    while (run_ && run_->loop.fault() && advance() != Progress::kEnded) {
    }
  }

  void begin() {
    // The old session's memory is released last: readers find one of the two at any time.
    auto next = std::make_unique<Run>(driver_, host_.place(), options_, stop_requested_, clock_);
    run_ = std::move(next);
    has_ended_ = false;
    last_fault_ = {};
    followers_.begin_session(host_, run_->writers);
  }

  // The next session gets the memory of the last session but one. If others still use that memory
  // and there is no other, the robot stays at rest until it is free. False if the back-end has to
  // stop instead.
  bool begin_when_there_is_memory() {
    bool was_reported = false;
    while (!stop_requested()) {
      try {
        begin();
        return true;
      } catch (const SystemError& error) {
        const bool is_full = error.error_number() == ENOSPC || error.error_number() == ENOMEM;
        if (run_ == nullptr || !is_full) throw;
        if (!was_reported && on_waiting_) on_waiting_(error.what());
        was_reported = true;
      }
      run_->loop.beat(clock_.now());
      std::this_thread::sleep_for(kWaitSlice);
    }
    return false;
  }

  // Does a tick without a deadline, or waits for room if there is none.
  Progress step() noexcept {
    const TimeIndex t = run_->loop.time_index();
    if (!is_real_time() && !followers_.have_room_for(t)) {
      followers_.wait(t);
      run_->loop.beat(clock_.now());
      return Progress::kHeldUp;
    }
    return run_->loop.tick(tick_now());
  }

  [[nodiscard]] detail::Tick tick_now() const noexcept { return {.time = clock_.now()}; }

  void run_with_deadlines() noexcept {
    const Nanoseconds suspended_before = suspended_time();
    bool driver_overran = false;
    Instant deadline = clock_.now();
    std::int64_t number = 0;
    while (true) {
      clock_.sleep_until(deadline);
      const Instant now = clock_.now();
      // The tick is late by whole periods: these ticks are left out, and the phase is kept.
      const std::int64_t skipped = (now - deadline) / options_.period;
      deadline += skipped * options_.period;
      number += skipped;
      const detail::Tick tick{.time = now,
                              .number = number,
                              .lateness = now - deadline,
                              .skipped = static_cast<std::uint32_t>(skipped),
                              .driver_overran = driver_overran,
                              .suspended = clock_.suspended_time() - suspended_before};
      if (run_->loop.tick(tick) == Progress::kEnded) return;
      deadline += options_.period;
      ++number;
      // The driver overran if it took more than half of a tick that was too long.
      const Instant end = clock_.now();
      driver_overran = end > deadline && 2 * run_->loop.driver_time() > end - now;
    }
  }

  // An interrupted look gives too small a value, so the largest of several is right.
  [[nodiscard]] Nanoseconds suspended_time() const noexcept {
    constexpr int kLooks = 8;
    Nanoseconds most = clock_.suspended_time();
    for (int i = 1; i < kLooks; ++i) most = std::max(most, clock_.suspended_time());
    return most;
  }

  void run_without_deadlines() noexcept {
    while (true) {
      const Progress progress = step();
      if (progress == Progress::kEnded) return;
      if (progress == Progress::kWaiting) wait_for_work();
    }
  }

  void wait_for_work() noexcept {
    detail::SessionWriter& robot = *run_->writers.robot;
    const std::atomic<std::uint32_t>& event = robot.action_header().event;
    // Observers have not yet been told of the last steps. If nobody waits, this is only one cheap
    // call before a long wait.
    ipc::futex_wake_all(robot.header().event);
    for (const auto& companion : run_->writers.companions) {
      ipc::futex_wake_all(companion->header().event);
    }
    while (true) {
      // acquire, before the look at the queue: an append in between changes the word, and the sleep
      // ends at once.
      const std::uint32_t seen = event.load(std::memory_order_acquire);
      // seq_cst, because the look at the queue comes after it: either we see the action, or append
      // sees that we sleep.
      robot.header().backend_waits.store(1, std::memory_order_seq_cst);
      const bool has_work = run_->loop.has_work();
      if (!has_work) ipc::futex_wait(event, seen, kWaitSlice);
      // relaxed: if the controller sees this late, it only makes one unnecessary call.
      robot.header().backend_waits.store(0, std::memory_order_relaxed);
      if (has_work) return;
      run_->loop.beat(clock_.now());
    }
  }

  [[nodiscard]] bool was_recovered() const noexcept {
    const auto requests =
        run_->writers.robot->action_header().requests.load(std::memory_order_acquire);
    return (requests & detail::kRecover) != 0;
  }

  void wait_for_recovery() {
    const std::atomic<std::uint32_t>& event = run_->writers.robot->action_header().event;
    while (!stop_requested()) {
      const std::uint32_t seen = event.load(std::memory_order_acquire);
      if (was_recovered()) return;
      // If the files were cut off, nobody can send a request; the next session has new files.
      if (last_fault_.code == Fault::Code::kMemoryDamaged && run_->writers.robot->is_cut_off()) {
        return;
      }
      // A process that was killed made its action late and cannot recover. The next user should not
      // have to.
      if (last_fault_.code == Fault::Code::kActionLate && run_->writers.robot->controller_died()) {
        return;
      }
      run_->loop.beat(clock_.now());
      ipc::futex_wait(event, seen, kWaitSlice);
    }
  }

  UntypedDriver& driver_;
  SessionHost& host_;
  BackendOptions options_;
  Clock& clock_;
  detail::Followers followers_;
  std::function<void(const Fault&)> after_session_;
  std::function<void(const std::string&)> on_waiting_;
  ipc::ForkGuard fork_;
  std::shared_ptr<const void> life_{std::make_shared<char>()};
  std::atomic<bool> stop_requested_{false};
  std::unique_ptr<Run> run_;
  bool has_ended_{false};
  Fault last_fault_;
};

Backend::Backend(UntypedDriver& driver, SessionHost& host, BackendOptions options, Clock& clock)
    : implementation_(std::make_unique<Implementation>(driver, host, options, clock)) {}
Backend::~Backend() = default;

void Backend::follow(Follower& follower) { implementation_->follow(follower); }
void Backend::run() { implementation_->run(); }
void Backend::set_after_session(std::function<void(const Fault&)> function) {
  implementation_->set_after_session(std::move(function));
}
void Backend::set_on_waiting(std::function<void(const std::string&)> function) {
  implementation_->set_on_waiting(std::move(function));
}
void Backend::request_stop() noexcept { implementation_->request_stop(); }
void Backend::begin_session() { implementation_->begin_session(); }
Progress Backend::advance() noexcept { return implementation_->advance(); }
void Backend::recover() noexcept { implementation_->recover(); }
const SessionHost& Backend::host() const noexcept { return implementation_->host(); }
const BackendOptions& Backend::options() const noexcept { return implementation_->options(); }

}  // namespace trifinger
