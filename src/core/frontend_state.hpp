// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "ipc/futex.hpp"
#include "ipc/ring.hpp"
#include "ipc/shared_memory.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/payload.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/fork.hpp"

namespace trifinger::detail {

class StandIn;

// Each session has its own files, so there is no event to wait for between two sessions.
inline constexpr auto kPollPeriod = std::chrono::milliseconds(1);
// Waits check the other side's health and call the interrupt at least this often.
inline constexpr Nanoseconds kSlice = std::chrono::milliseconds(100);

// A session, and its action file if the front-end controls it.
struct Part {
  std::shared_ptr<const SessionMapping> mapping;
  std::optional<ipc::SharedMemory> action{};
};

// Which thread moves an inline robot: the one that has made the front-end, or the one that has
// controlled the robot last. A front-end and its companions share one.
class InlineThread {
 public:
  // Makes the calling thread the one. False if another thread is moving the robot just now.
  [[nodiscard]] bool take() noexcept {
    // relaxed: only the thread itself finds its own number.
    if (thread_.load(std::memory_order_relaxed) == std::this_thread::get_id()) return true;
    const std::lock_guard lock(mutex_);
    if (depth_ > 0) return false;
    thread_.store(std::this_thread::get_id(), std::memory_order_relaxed);
    return true;
  }

  enum class Taking : std::uint8_t { kNo, kYes };

  // True while the calling thread may move the robot; nobody can take it meanwhile. Uses may nest,
  // because a safety check may wait within a step.
  class Use {
   public:
    explicit Use(InlineThread& inline_thread, Taking taking = Taking::kNo) : of_(inline_thread) {
      const auto self = std::this_thread::get_id();
      const std::lock_guard lock(of_.mutex_);
      if (taking == Taking::kYes && of_.depth_ == 0) {
        of_.thread_.store(self, std::memory_order_relaxed);
      }
      is_own_ = of_.thread_.load(std::memory_order_relaxed) == self;
      if (is_own_) ++of_.depth_;
    }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    ~Use() {
      if (!is_own_) return;
      const std::lock_guard lock(of_.mutex_);
      --of_.depth_;
    }
    explicit operator bool() const noexcept { return is_own_; }

   private:
    InlineThread& of_;
    bool is_own_{false};
  };

 private:
  std::mutex mutex_;
  std::atomic<std::thread::id> thread_{std::this_thread::get_id()};
  int depth_{0};  // number of waits in which `thread_` moves the robot
};

// What a front-end knows, and how it waits. If the back-end is in another thread or process, a wait
// sleeps; if the back-end is inline, the wait runs it.
struct FrontendState {
  // `backend` is null if another thread runs the back-end.
  explicit FrontendState(Part part, bool its_strictness = false, Backend* backend = nullptr,
                         std::shared_ptr<void> its_owner = nullptr);
  // Gives control back.
  ~FrontendState();

  [[nodiscard]] const StateHeader& header() const noexcept { return mapping->header(); }
  // Null for a handle that only observes.
  [[nodiscard]] ActionHeader* action_header() const noexcept {
    return action ? reinterpret_cast<ActionHeader*>(action->data()) : nullptr;
  }
  // Throws InheritedHandle in a forked child.
  void require_own() const;
  // Throws InvalidArgument for a handle that only observes.
  void require_control() const;
  // Throws InvalidArgument if the inline back-end was destroyed.
  void require_backend() const;
  // Throws ControlHeld: another thread moves an inline robot just now.
  [[noreturn]] void throw_moved() const;
  [[noreturn]] void throw_stopped() const;

  // Waits until `ready()`. `wanted` tells the back-end when to wake us. `what` names the awaited
  // thing, for the error if it does not come. Throws TimedOut, ActionMissing, RobotStopped.
  template <class Ready, class What>
  void wait(const Ready& ready, const Wanted& wanted, Timeout timeout, const What& what) const;
  // Brings the robot of an inline back-end to rest.
  void run_inline_to_end() const noexcept;
  // Puts `queue_entry` into the queue as the action of step `t`.
  void put(TimeIndex t) noexcept;

  std::shared_ptr<void> owner;  // destroyed last, because it contains the inline back-end
  std::shared_ptr<const SessionMapping> mapping;
  Session session{mapping};
  std::optional<ipc::SharedMemory> action;
  std::unique_ptr<const PayloadReader> payloads;  // only for companions with payloads
  bool is_strict;
  Backend* inline_backend;
  std::weak_ptr<const void> backend_life;  // of the inline back-end
  std::shared_ptr<InlineThread> inline_thread{std::make_shared<InlineThread>()};
  std::function<void()> interrupt;
  ipc::ForkGuard fork;
  ipc::Ring queue;
  std::vector<std::uint64_t> queue_entry;
  TimeIndex last_appended{-1};
  std::unique_ptr<StandIn> stand_in;              // null if nobody appends for the program
  mutable std::atomic<TimeIndex> handed_out{-1};  // newest step whose observation the user knows
  mutable std::atomic<bool> backend_died{false};

 private:
  template <class Ready, class What>
  void run_inline(const Ready& ready, Timeout timeout, const What& what) const;
  template <class Ready>
  void throw_if_backend_died(const Ready& ready) const;
  void look_for_interrupted_step() const;
};

void send_request(ActionHeader& header, Request what) noexcept;
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

inline void FrontendState::put(TimeIndex t) noexcept {
  queue.write(t, queue_entry.data(), std::memory_order_seq_cst);
  last_appended = t;
  auto& event = action_header()->event;
  // release, because the slot was written before: a back-end that has seen the new word finds
  // the action. A back-end that has not found the action can only sleep on the old word.
  event.store(event.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  // seq_cst: either the back-end found the action before it went to sleep, or we see that it
  // sleeps.
  if (header().backend_waits.load(std::memory_order_seq_cst) != 0) ipc::futex_wake_all(event);
}

template <class Ready, class What>
void FrontendState::wait(const Ready& ready, const Wanted& wanted, Timeout timeout,
                         const What& what) const {
  if (inline_backend != nullptr) {
    const InlineThread::Use use(*inline_thread);
    if (use) {
      run_inline(ready, timeout, what);
      return;
    }
  }
  const Deadline deadline(timeout);
  Deadline slice(kSlice);
  while (true) {
    // seq_cst: the wait slot comes after it, see SessionWriter::announce.
    const std::uint32_t event = header().event.load(std::memory_order_seq_cst);
    const bool has_ended = mapping->has_ended();
    if (ready()) return;
    if (has_ended) throw_stopped();
    if (deadline.passed()) {
      // A caller that looks often and never waits long must learn of the death, too.
      throw_if_backend_died(ready);
      if (ready()) return;
      if (mapping->has_ended()) continue;
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
    if (interrupt) interrupt();
    throw_if_backend_died(ready);
  }
}

template <class Ready>
void FrontendState::throw_if_backend_died(const Ready& ready) const {
  // A back-end releases its lock after its last word, so check once more for that word.
  if (mapping->backend_is_alive() || mapping->has_ended() || ready()) return;
  // relaxed: see append_desired_action, which has no time to look itself.
  backend_died.store(true, std::memory_order_relaxed);
  throw_stopped();
}

template <class Ready, class What>
void FrontendState::run_inline(const Ready& ready, Timeout timeout, const What& what) const {
  // Reading the clock costs as much as a step of a small robot.
  constexpr int kStepsPerLook = 64;
  const Deadline deadline(timeout);
  Instant last_call{};
  int steps = 0;
  while (true) {
    const bool has_ended = mapping->has_ended();
    if (has_ended) look_for_interrupted_step();
    if (ready()) return;
    if (has_ended) throw_stopped();
    require_backend();
    const Progress progress = inline_backend->advance();
    if (progress == Progress::kWaiting && !ready()) {
      throw ActionMissing(what() + " needs an action that has not been appended: step " +
                          std::to_string(header().next_action.load(std::memory_order_relaxed)));
    }
    if (progress != Progress::kHeldUp && ++steps % kStepsPerLook != 0) continue;
    if (deadline.passed() && !ready()) throw TimedOut(what() + " did not come in time");
    const Instant now = std::chrono::steady_clock::now();
    if (interrupt && now - last_call >= kSlice) {
      last_call = now;
      interrupt();
    }
  }
}

}  // namespace trifinger::detail
