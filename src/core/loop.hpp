// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "session_layout.hpp"
#include "session_place.hpp"
#include "session_writer.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/core/timing.hpp"

namespace trifinger::detail {

// The beginning of a tick. Without deadlines, only `time` has a meaning.
struct Tick {
  Instant time;
  std::int64_t number{0};
  Nanoseconds lateness{0};
  std::uint32_t skipped{0};
  bool driver_overran{false};  // calls of the driver used up the tick before
  Nanoseconds suspended{0};    // how long the machine was suspended since the session began
};

// Takes one session through its stages, tick by tick. No function here allocates, locks, throws or
// waits. The only system call wakes sleeping readers.
class Loop {
 public:
  Loop(UntypedDriver& driver, SessionPlace::Writers& writers, const BackendOptions& options,
       const std::atomic<bool>& stop_requested, const Clock& clock);

  // Does one tick.
  [[nodiscard]] Progress tick(const Tick& now) noexcept TRIFINGER_REALTIME;

  // The watchdog calls this when the controlling process has died.
  void note_controller_died() noexcept { controller_died_.store(true, std::memory_order_relaxed); }
  // The watchdog reads this count. It grows when a call of the driver begins and when it ends; it
  // is odd during a call.
  [[nodiscard]] std::uint64_t driver_calls() const noexcept {
    return driver_calls_.load(std::memory_order_relaxed);
  }
  // The watchdog calls this when the driver hangs.
  void cut() noexcept;

  // With deadlines: the time that the last tick spent in calls of the driver.
  [[nodiscard]] Nanoseconds driver_time() const noexcept { return driver_time_; }
  // The current step.
  [[nodiscard]] TimeIndex time_index() const noexcept { return time_index_; }
  // True if the next tick could do more than wait, because an action or a request is there.
  [[nodiscard]] bool has_work() const noexcept;
  void beat(Instant now) noexcept;
  // Why the session ended; kNone before the end.
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
  // Applies the desired action and completes the step.
  Progress apply_action() noexcept;
  Take take_action() noexcept;
  Take close_index() noexcept;
  [[nodiscard]] Fault end_request() const noexcept;
  void note_lateness(const Tick& now) noexcept;
  void set_phase(Phase phase) noexcept;
  void publish_observation() noexcept;
  void record_timing() noexcept;
  void publish_companions(const Tick& now, TimeIndex time_index) noexcept;
  // The newest step that had begun at `time`; the one before the first if none had.
  [[nodiscard]] TimeIndex step_at(std::int64_t time, TimeIndex newest) const noexcept;
  void announce(bool always) noexcept;
  Progress end(Fault::Code code, std::int32_t detail) noexcept;
  // Ends the session for the reason in `report`, for which `breaks_off` must be true.
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
  Fault cut_fault_;  // written by the watchdog before it sets the two flags above

  // One element each. They are arrays of words, so that they are aligned for every type.
  using Element = std::vector<std::uint64_t>;
  Element queue_entry_;  // flags, then the action
  Element desired_;
  Element applied_;
  Element observation_;
  Element hold_action_;
  std::vector<Element> companion_elements_;
  // When the last steps began [ns], for companions that know no steps: step t is at t modulo the
  // size, a power of two. Empty if there are no companions.
  std::vector<std::int64_t> begins_;

  Stage stage_{Stage::kPreparing};
  TimeIndex count_{0};    // number of calls in the stages kPreparing and kStopping
  TimeIndex time_index_;  // the current step
  Status status_;
  TimingRecord timing_;
  std::uint32_t late_in_a_row_{0};
  Nanoseconds driver_time_{0};
  Nanoseconds suspended_{0};
  bool is_measured_{false};   // y of the current step is in observation_
  bool is_published_{false};  // y of the current step is in its series
  bool has_hold_action_{false};
  TimeIndex closed_index_{-1};  // last step closed without an action: its action may come late
  std::int64_t first_tick_{0};
  Instant holding_since_;
  Instant last_wake_;
  Instant last_time_;
  Fault fault_;
};

}  // namespace trifinger::detail
