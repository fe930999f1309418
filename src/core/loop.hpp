// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "session_memory.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/core/timing.hpp"

namespace trifinger::detail {

// When a tick begins. Without deadlines, only `time` says something.
struct Tick {
  Instant time;
  std::int64_t number{0};
  Nanoseconds lateness{0};
  std::uint32_t skipped{0};
  bool driver_overran{false};  // calls of the driver took up the tick before
  Nanoseconds suspended{0};    // for how long the machine has slept since the session began
};

// One session's way through its stages, tick by tick. No function here allocates, locks, throws or
// waits; the only system call is the wake of sleeping readers.
class Loop {
 public:
  Loop(UntypedDriver& driver, SessionPlace::Writers& writers, const BackendOptions& options,
       const std::atomic<bool>& stop_requested, const Clock& clock);

  // Does one tick.
  [[nodiscard]] Progress tick(const Tick& now) noexcept TRIFINGER_REALTIME;

  // From the watchdog: the controlling process has died.
  void note_controller_died() noexcept { controller_died_.store(true, std::memory_order_relaxed); }
  // From the watchdog: counts up when a call of the driver begins and when it ends; odd while one
  // lasts.
  [[nodiscard]] std::uint64_t driver_calls() const noexcept {
    return driver_calls_.load(std::memory_order_relaxed);
  }
  // From the watchdog, when the driver hangs.
  void cut() noexcept;

  // With deadlines: the time that the last tick has spent in calls of the driver.
  [[nodiscard]] Nanoseconds driver_time() const noexcept { return driver_time_; }
  // The step in work.
  [[nodiscard]] TimeIndex time_index() const noexcept { return time_index_; }
  // True if the next tick could do more than wait: an action or a request is there.
  [[nodiscard]] bool has_work() const noexcept;
  void beat(Instant now) noexcept;
  // Why the session ended, once it has.
  [[nodiscard]] Fault fault() const noexcept;

 private:
  enum class Stage : std::uint8_t { kPreparing, kHolding, kRunning, kStopping, kDone };
  enum class Take : std::uint8_t { kTaken, kMissing, kDamaged };

  Progress prepare(const Tick& now) noexcept;
  Progress hold(const Tick& now) noexcept;
  Progress run(const Tick& now) noexcept;
  Progress stop() noexcept;
  Progress rest() noexcept;

  bool measure(const Tick& now) noexcept;
  Take take_action() noexcept;
  Take close_index() noexcept;
  [[nodiscard]] Fault end_request() const noexcept;
  void note_lateness(const Tick& now) noexcept;
  void set_phase(layout::Phase phase) noexcept;
  void publish_observation() noexcept;
  void record_timing() noexcept;
  void publish_companions(const Tick& now, TimeIndex time_index) noexcept;
  void announce(bool always) noexcept;
  Progress end(Fault::Code code, std::int32_t detail) noexcept;
  // As a report says that `breaks_off`.
  Progress end(const DriverReport& report) noexcept;
  template <class Call>
  DriverReport call_driver(const Call& call) noexcept;

  [[nodiscard]] bool is_real_time() const noexcept {
    return options_.mode == BackendOptions::Mode::kRealTime;
  }
  [[nodiscard]] std::uint32_t requests() const noexcept {
    // acquire: actions appended before finish() are visible with it.
    return writer_.action_header().requests.load(std::memory_order_acquire);
  }

  UntypedDriver& driver_;
  SessionWriter& writer_;
  std::vector<std::unique_ptr<SessionWriter>>& companions_;
  const BackendOptions& options_;
  const std::atomic<bool>& stop_requested_;
  const Clock& clock_;
  const Nanoseconds late_after_;
  std::atomic<bool> controller_died_{false};
  std::atomic<std::uint64_t> driver_calls_{0};
  std::atomic<bool> was_cut_{false};
  std::atomic<bool> is_cut_the_end_{false};
  Fault cut_fault_;  // the watchdog's, behind these two

  // One element each, as words so that they are aligned for every type.
  using Element = std::vector<std::uint64_t>;
  Element queue_entry_;  // flags, then the action
  Element desired_;
  Element applied_;
  Element observation_;
  Element hold_action_;
  std::vector<Element> companion_elements_;

  Stage stage_{Stage::kPreparing};
  TimeIndex count_{0};    // of calls in the stages kPreparing and kStopping
  TimeIndex time_index_;  // the step in work
  Status status_;
  TimingRecord timing_;
  std::uint32_t late_in_a_row_{0};
  Nanoseconds driver_time_{0};
  Nanoseconds suspended_{0};
  bool is_measured_{false};   // y of the step in work is in observation_
  bool is_published_{false};  // and in its series
  bool has_hold_action_{false};
  TimeIndex closed_index_{-1};  // the last step closed without an action, to count what came late
  std::int64_t first_tick_{0};
  Instant holding_since_;
  Instant last_wake_;
  Instant last_time_;
  Fault fault_;
};

}  // namespace trifinger::detail
