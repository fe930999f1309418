// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/ipc/futex.hpp"
#include "trifinger/ipc/shared_memory.hpp"

namespace trifinger::detail {

// Each session has its own files, so there is no event to wait for between two sessions.
inline constexpr auto kPollPeriod = std::chrono::milliseconds(1);

// What a front-end holds of a session: the mapped files, and the ways to wait. If the back-end is
// in another thread or process, a wait sleeps; if it is inline, the wait runs it.
class SessionHandle {
 public:
  // `action` is the action file of a front-end in control. `inline_backend` is null if another
  // thread runs the back-end.
  SessionHandle(std::shared_ptr<const SessionMapping> mapping,
                std::optional<ipc::SharedMemory> action, Backend* inline_backend)
      : mapping_(std::move(mapping)),
        action_(std::move(action)),
        inline_backend_(inline_backend),
        thread_(std::this_thread::get_id()) {}

  [[nodiscard]] const std::shared_ptr<const SessionMapping>& mapping() const noexcept {
    return mapping_;
  }
  [[nodiscard]] const StateHeader& header() const noexcept { return mapping_->header(); }
  // Null for a front-end that only observes.
  [[nodiscard]] ActionHeader* action_header() const noexcept {
    return action_ ? reinterpret_cast<ActionHeader*>(action_->data()) : nullptr;
  }
  [[nodiscard]] Backend* inline_backend() const noexcept { return inline_backend_; }
  // Waits call `interrupt` at least every 100 ms.
  void set_interrupt(std::function<void()> interrupt) { interrupt_ = std::move(interrupt); }
  [[nodiscard]] const std::function<void()>& interrupt() const noexcept { return interrupt_; }

  [[nodiscard]] bool is_inherited() const noexcept { return fork_.is_inherited(); }
  // Throws InheritedHandle in a forked child.
  void require_own() const;
  // Throws RobotStopped or, in the thread of an inline back-end, what the interrupt throws.
  [[noreturn]] void throw_stopped() const;
  // True once a wait has found that the back-end died.
  [[nodiscard]] bool backend_died() const noexcept {
    // relaxed: no other data depends on this flag.
    return backend_died_.load(std::memory_order_relaxed);
  }

  // Waits until `ready()`. `wanted` tells the back-end when to wake us. `what` names the awaited
  // thing, for the error if it does not come. Throws TimedOut, ActionMissing, RobotStopped.
  template <class Ready, class What>
  void wait(const Ready& ready, const Wanted& wanted, Timeout timeout, const What& what) const;
  // Brings the robot of an inline back-end to rest.
  void run_inline_to_end() const noexcept;

 private:
  template <class Ready, class What>
  void run_inline(const Ready& ready, Timeout timeout, const What& what) const;
  template <class Ready>
  void throw_if_backend_died(const Ready& ready) const;
  void look_for_interrupted_step() const;

  // Waits check the other side's health and call the interrupt at least this often.
  static constexpr Nanoseconds kSlice = std::chrono::milliseconds(100);

  std::shared_ptr<const SessionMapping> mapping_;
  std::optional<ipc::SharedMemory> action_;
  Backend* inline_backend_;
  std::thread::id thread_;
  std::function<void()> interrupt_;
  ipc::ForkGuard fork_;
  mutable std::atomic<bool> backend_died_{false};
};

// Waits until the back-end has begun the session after `ended`. Throws TimedOut, RobotStopped, and
// what `interrupt` throws.
void wait_for_next_session(const SessionMapping& ended, Timeout timeout,
                           const std::function<void()>& interrupt = {});

// Tells in the action file what a thread of the controller waits for, as long as it waits.
class WaitSlot {
 public:
  WaitSlot(ActionHeader* header, const Wanted& wanted) noexcept {
    if (header == nullptr) return;
    for (auto& slot : header->wait_slots) {
      std::uint64_t expected = 0;
      // seq_cst, because a look at the event comes after it: see SessionWriter::announce.
      if (slot.compare_exchange_strong(expected, wanted.word(), std::memory_order_seq_cst)) {
        slot_ = &slot;
        return;
      }
    }
  }
  WaitSlot(const WaitSlot&) = delete;
  WaitSlot& operator=(const WaitSlot&) = delete;
  ~WaitSlot() {
    // relaxed: if the other side sees this late, one wake-up is wasted.
    if (slot_ != nullptr) slot_->store(0, std::memory_order_relaxed);
  }

 private:
  std::atomic<std::uint64_t>* slot_{nullptr};
};

template <class Ready, class What>
void SessionHandle::wait(const Ready& ready, const Wanted& wanted, Timeout timeout,
                         const What& what) const {
  if (inline_backend_ != nullptr && std::this_thread::get_id() == thread_) {
    run_inline(ready, timeout, what);
    return;
  }
  const Deadline deadline(timeout);
  Deadline slice(kSlice);
  while (true) {
    // seq_cst: the wait slot comes after it, see SessionWriter::announce.
    const std::uint32_t event = header().event.load(std::memory_order_seq_cst);
    const bool has_ended = mapping_->has_ended();
    if (ready()) return;
    if (has_ended) throw_stopped();
    if (deadline.passed()) {
      // A caller that looks often and never waits long must learn of the death, too.
      throw_if_backend_died(ready);
      if (ready()) return;
      if (mapping_->has_ended()) continue;
      throw TimedOut(what() + " did not come in time");
    }
    {
      const WaitSlot slot(action_header(), wanted);
      if (header().event.load(std::memory_order_seq_cst) == event) {
        ipc::futex_wait(header().event, event, deadline.remaining(kSlice));
      }
    }
    if (!slice.passed()) continue;
    slice = Deadline(kSlice);
    if (interrupt_) interrupt_();
    throw_if_backend_died(ready);
  }
}

template <class Ready>
void SessionHandle::throw_if_backend_died(const Ready& ready) const {
  // A back-end releases its lock after its last word, so check once more for that word.
  if (mapping_->backend_is_alive() || mapping_->has_ended() || ready()) return;
  // relaxed: see backend_died. An append has no time to look itself.
  backend_died_.store(true, std::memory_order_relaxed);
  throw_stopped();
}

template <class Ready, class What>
void SessionHandle::run_inline(const Ready& ready, Timeout timeout, const What& what) const {
  // Reading the clock costs as much as a step of a small robot.
  constexpr int kStepsPerLook = 64;
  const Deadline deadline(timeout);
  Instant last_interrupt{};
  int steps = 0;
  while (true) {
    const bool has_ended = mapping_->has_ended();
    if (has_ended) look_for_interrupted_step();
    if (ready()) return;
    if (has_ended) throw_stopped();
    const Progress progress = inline_backend_->advance();
    if (progress == Progress::kWaiting && !ready()) {
      throw ActionMissing(what() + " needs an action that has not been appended: step " +
                          std::to_string(header().next_action.load(std::memory_order_relaxed)));
    }
    if (progress != Progress::kHeldUp && ++steps % kStepsPerLook != 0) continue;
    if (deadline.passed() && !ready()) throw TimedOut(what() + " did not come in time");
    const Instant now = std::chrono::steady_clock::now();
    if (interrupt_ && now - last_interrupt >= kSlice) {
      last_interrupt = now;
      interrupt_();
    }
  }
}

}  // namespace trifinger::detail
