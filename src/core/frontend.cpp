// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/frontend.hpp"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <thread>
#include <vector>

#include "session_directory.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/ipc/file_lock.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/ipc/futex.hpp"

namespace trifinger {
namespace {

using detail::SessionMapping;
using detail::Wanted;

// Waits check the other side's health and call the interrupt at least this often.
constexpr Nanoseconds kSlice = std::chrono::milliseconds(100);
// Each session has its own files, so there is no event to wait for between two sessions.
constexpr auto kPollPeriod = std::chrono::milliseconds(1);

void send_request(detail::ActionHeader& header, detail::Request what) noexcept {
  // release: whoever sees the request also sees the actions appended before.
  header.requests.fetch_or(what, std::memory_order_release);
  header.event.fetch_add(1, std::memory_order_seq_cst);
  ipc::futex_wake_all(header.event);
}

// Tells in the action file what a thread of the controller waits for, as long as it waits.
class WaitSlot {
 public:
  WaitSlot(detail::ActionHeader* header, const Wanted& wanted) noexcept {
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

}  // namespace

class UntypedFrontend::Implementation {
 public:
  Implementation(std::shared_ptr<const SessionMapping> mapping,
                 std::optional<ipc::SharedMemory> action, const FrontendOptions& options,
                 Backend* inline_backend, std::shared_ptr<void> owner = nullptr)
      : owner_(std::move(owner)),
        mapping_(std::move(mapping)),
        session_(mapping_),
        action_(std::move(action)),
        options_(options),
        inline_backend_(inline_backend),
        thread_(std::this_thread::get_id()) {
    if (!action_) return;
    const detail::RingPlace& queue = header().queue;
    queue_ = ipc::Ring(action_->data() + queue.offset, queue.shape);
    queue_entry_.resize((queue.shape.element_size + 7) / 8);
  }

  ~Implementation() {
    if (!action_ || fork_.is_inherited()) return;
    if (last_appended_ < 0) {
      // release: the lock is given back later, together with the file.
      action_header()->controller_pid.store(0, std::memory_order_release);
    } else {
      // This is needed after the end, too: a controller that leaves without it counts as dead.
      request(detail::kDetach);
      run_inline_to_end();
    }
  }
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  TimeIndex append(const void* action, Timeout timeout) {
    require_own();
    require_control();
    while (true) {
      // relaxed: no other data depends on this flag.
      const bool has_died = backend_died_.load(std::memory_order_relaxed);
      if (has_died || mapping_->has_ended()) throw_stopped();
      // acquire: the slots of indices taken before are free.
      const TimeIndex open = header().next_action.load(std::memory_order_acquire);
      const TimeIndex t = std::max(last_appended_ + 1, open);
      const auto capacity = static_cast<TimeIndex>(queue_.shape().capacity);
      if (t - open >= capacity) {
        wait_for_queue_space(t - capacity, timeout);
        continue;
      }
      // relaxed: this thread set it, or a thread whose read has no fixed order with this append.
      const bool is_acausal = t <= handed_out_.load(std::memory_order_relaxed);
      if (is_acausal && options_.strict) throw AcausalAction(t);

      queue_entry_[0] = is_acausal ? detail::QueueFlags::kAcausal : 0;
      std::memcpy(queue_entry_.data() + 1, action, queue_.shape().element_size - 8);
      queue_.write(t, queue_entry_.data(), std::memory_order_seq_cst);
      last_appended_ = t;
      auto& event = action_header()->event;
      // release, because the slot was written before: a back-end that has seen the new word finds
      // the action. A back-end that has not found the action can only sleep on the old word.
      event.store(event.load(std::memory_order_relaxed) + 1, std::memory_order_release);
      // seq_cst: either the back-end found the action before it went to sleep, or we see that it
      // sleeps.
      if (header().backend_waits.load(std::memory_order_seq_cst) != 0) ipc::futex_wake_all(event);
      // seq_cst: a back-end that closes t says so before it looks for the action once more. If t is
      // not closed here, the back-end will find the action.
      if (header().is_real_time == 0 || header().next_action.load(std::memory_order_seq_cst) <= t ||
          was_taken(t)) {
        return t;
      }
    }
  }

  TimeIndex append(const void* actions, std::size_t count, Timeout timeout) {
    if (count == 0) throw InvalidArgument("a burst needs at least one action");
    const std::size_t size = description().action.size();
    TimeIndex t = -1;
    for (std::size_t i = 0; i < count; ++i) {
      t = append(static_cast<const std::byte*>(actions) + i * size, timeout);
    }
    return t;
  }

  bool try_get(Series series, TimeIndex t, void* element) const {
    require_own();
    if (t < header().first_index) {
      throw InvalidArgument("step " + std::to_string(t) + " does not exist; steps begin at " +
                            std::to_string(header().first_index));
    }
    if (!mapping_->has(series)) static_cast<void>(mapping_->element(series));  // throws
    switch (mapping_->ring(series).read(t, element)) {
      case ipc::ReadResult::kDone:
        if (series == Series::kObservation) hand_out(t);
        return true;
      case ipc::ReadResult::kLost:
        throw_lost(series, t);
      case ipc::ReadResult::kNotYet:
        break;
    }
    return false;
  }

  void get(Series series, TimeIndex t, void* element, Timeout timeout) const {
    if (try_get(series, t, element)) return;
    wait_for(series, t, timeout);
    // The element was there a moment ago. If not found, the writer is now a whole history further.
    if (!try_get(series, t, element)) throw_lost(series, t);
  }

  void get(Series series, TimeIndex first, std::size_t count, void* elements,
           Timeout timeout) const {
    if (count == 0) return;
    const std::size_t size = mapping_->element(series).size();
    const auto capacity = mapping_->ring(series).shape().capacity;
    if (count > capacity) {
      throw InvalidArgument(std::to_string(count) +
                            " steps at once are more than the history keeps (" +
                            std::to_string(capacity) + ")");
    }
    auto* target = static_cast<std::byte*>(elements);
    // The last element is read first: if it exists, all exist.
    get(series, first + static_cast<TimeIndex>(count) - 1, target + (count - 1) * size, timeout);
    for (std::size_t i = 0; i + 1 < count; ++i) {
      const TimeIndex t = first + static_cast<TimeIndex>(i);
      if (!try_get(series, t, target + i * size)) throw_lost(series, t);
    }
  }

  void wait_for(Series series, TimeIndex t, Timeout timeout) const {
    require_own();
    const auto kind = series == Series::kObservation ? Wanted::kObservation : Wanted::kStep;
    wait([this, series, t] { return mapping_->end_of(series) > t; }, {kind, t}, timeout,
         [series, t] {
           return "step " + std::to_string(t) + " of " + std::string(name_of(series));
         });
  }

  void latest_observation(void* observation, Timeout timeout) const {
    require_own();
    const auto is_there = [&] {
      // The writer may overtake us by a whole history between the two calls; then there is a newer
      // observation.
      while (true) {
        const TimeIndex end = mapping_->end_of(Series::kObservation);
        const Series series = end > header().first_index || !mapping_->has(Series::kHolding)
                                  ? Series::kObservation
                                  : Series::kHolding;
        const TimeIndex newest = mapping_->end_of(series) - 1;
        if (newest < 0) return false;
        if (mapping_->ring(series).read(newest, observation) != ipc::ReadResult::kDone) {
          if (mapping_->end_of(series) - 1 == newest) return false;  // damaged
          continue;
        }
        if (series == Series::kObservation) hand_out(newest);
        return true;
      }
    };
    if (is_there()) return;
    wait(is_there, {Wanted::kAnything, 0}, timeout, [] { return std::string("an observation"); });
  }

  bool get_latest_at(TimeIndex t, void* element, Timeout timeout) const {
    require_own();
    if (!mapping_->is_companion()) {
      throw InvalidArgument("get_latest_at reads companions; robot '" + mapping_->name() +
                            "' has one element per step: use get_observation");
    }
    const auto is_complete = [this, t] {
      // acquire: all elements of that step were written before.
      return header().complete_through.load(std::memory_order_acquire) >= t;
    };
    if (!is_complete()) {
      wait(is_complete, {Wanted::kAnything, t}, timeout,
           [t] { return "step " + std::to_string(t) + " of the robot"; });
    }
    const ipc::Ring& ring = mapping_->ring(Series::kObservation);
    const TimeIndex end = mapping_->end_of(Series::kObservation);
    TimeIndex oldest = t + 1;
    for (TimeIndex i = end - 1; i >= 0; --i) {
      if (ring.read(i, element) != ipc::ReadResult::kDone) throw HistoryLost(t, oldest);
      // The caller's buffer may not be aligned.
      Stamp stamp;
      std::memcpy(&stamp, element, sizeof(stamp));
      if (stamp.arrival_index <= t) return true;
      oldest = stamp.arrival_index;
    }
    return false;
  }

  [[nodiscard]] TimeIndex current_time_index() const {
    require_own();
    return mapping_->end_of(Series::kObservation) - 1;
  }

  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(Series series) const {
    const TimeIndex end = mapping_->end_of(series);
    const auto capacity = static_cast<TimeIndex>(mapping_->ring(series).shape().capacity);
    return {std::max(mapping_->begin_of(series), end - capacity), end};
  }

  [[nodiscard]] std::optional<Fault> fault() const {
    require_own();
    if (mapping_->has_ended() || (inline_backend_ == nullptr && !mapping_->backend_is_alive())) {
      return mapping_->fault();
    }
    return std::nullopt;
  }

  void finish(Timeout timeout) {
    require_own();
    require_control();
    if (!mapping_->has_ended()) {
      request(detail::kFinish);
      wait([this] { return mapping_->has_ended(); }, {Wanted::kAnything, 0}, timeout,
           [] { return std::string("the end of the session"); });
      run_inline_to_end();
    }
    // The session may have ended before the request, for a reason that left some actions unused.
    const Fault fault = mapping_->fault();
    const bool is_as_good =
        fault.code == Fault::Code::kExhausted && last_appended_ < fault.time_index;
    if (fault.code != Fault::Code::kFinished && !is_as_good) throw_stopped();
  }

  void recover(Timeout timeout) {
    require_own();
    if (inline_backend_ != nullptr) {
      inline_backend_->recover();
      return;
    }
    const Deadline deadline(timeout);
    if (!mapping_->has_ended()) {
      if (!mapping_->backend_is_alive()) throw_stopped();
      return;
    }
    require_control();
    request(detail::kRecover);
    Deadline slice(kSlice);
    while (true) {
      try {
        const SessionMapping current(mapping_->directory(), mapping_->name());
        if (current.header().session_id != header().session_id) return;
        if (!current.backend_is_alive()) throw_stopped();
      } catch (const SystemError& error) {
        if (error.error_number() != ENOENT) throw;
        throw_stopped();
      }
      if (deadline.passed()) {
        throw TimedOut("robot '" + mapping_->name() +
                       "' has not begun a new session after the fault; 'trifinger stop " +
                       mapping_->name() + "' ends its back-end");
      }
      if (interrupt_ && slice.passed()) {
        slice = Deadline(kSlice);
        interrupt_();
      }
      std::this_thread::sleep_for(kPollPeriod);
    }
  }

  [[nodiscard]] std::unique_ptr<Implementation> companion(const std::string& name) const {
    require_own();
    auto implementation = std::make_unique<Implementation>(mapping_->companion(name), std::nullopt,
                                                           FrontendOptions{.control = false},
                                                           inline_backend_, owner_);
    implementation->interrupt_ = interrupt_;
    return implementation;
  }

  [[nodiscard]] const Session& session() const { return session_; }
  void set_interrupt(std::function<void()> interrupt) { interrupt_ = std::move(interrupt); }

 private:
  [[nodiscard]] const detail::StateHeader& header() const noexcept { return mapping_->header(); }
  [[nodiscard]] detail::ActionHeader* action_header() const noexcept {
    return action_ ? reinterpret_cast<detail::ActionHeader*>(action_->data()) : nullptr;
  }
  [[nodiscard]] const RobotTypes& description() const noexcept { return mapping_->description(); }

  void require_own() const {
    if (fork_.is_inherited()) {
      throw InheritedHandle("this handle of '" + mapping_->name() +
                            "' was made before fork(); connect again in the child process");
    }
  }
  void require_control() const {
    if (!action_) {
      throw InvalidArgument("this handle of '" + mapping_->name() +
                            "' only observes; use connect() to control the robot");
    }
  }

  [[noreturn]] void throw_stopped() const {
    look_for_interrupted_step();
    mapping_->throw_stopped();
  }

  // If the user's own code has ended an inline session within a step, the interrupt reports that
  // first.
  void look_for_interrupted_step() const {
    if (inline_backend_ != nullptr && interrupt_) interrupt_();
  }

  [[noreturn]] void throw_lost(Series series, TimeIndex t) const {
    // The writer may be overwriting the slot of t and count it only later.
    throw HistoryLost(t, std::max(t + 1, range(series).first));
  }

  void request(detail::Request what) const noexcept { send_request(*action_header(), what); }

  // Brings the robot of an inline back-end to rest. If a later session has begun, the loop below
  // stops as soon as that session waits for an action.
  void run_inline_to_end() const noexcept {
    if (inline_backend_ == nullptr) return;
    for (auto progress = Progress::kStepped;
         progress == Progress::kStepped || progress == Progress::kHeldUp;) {
      progress = inline_backend_->advance();
    }
  }

  // Remembers that the user knows y_t.
  void hand_out(TimeIndex t) const noexcept {
    // relaxed: see append. Several readers may race here. Only the newest step counts, and an error
    // of one step does not matter.
    if (t > handed_out_.load(std::memory_order_relaxed)) {
      handed_out_.store(t, std::memory_order_relaxed);
    }
  }

  // True if the action appended for `t` was applied; false if it came too late. The back-end has
  // already passed `t`.
  [[nodiscard]] bool was_taken(TimeIndex t) const {
    Status status;
    try {
      // The user's timeout does not apply: the action is on its way, and the back-end is just now
      // doing the tick that decides.
      get(Series::kStatus, t, &status, kForever);
    } catch (const HistoryLost&) {
      return false;
    }
    if ((status.flags & Status::kEnd) != 0) throw_stopped();
    return (status.flags & Status::kActionRepeated) == 0;
  }

  void wait_for_queue_space(TimeIndex taken, Timeout timeout) const {
    wait([this, taken] { return header().next_action.load(std::memory_order_acquire) > taken; },
         {Wanted::kQueueSpace, taken}, timeout,
         [] { return std::string("a free place in the queue of actions"); });
  }

  // Waits until `ready()`. `what` names the awaited thing, for the error if it does not come.
  template <class Ready, class What>
  void wait(const Ready& ready, const Wanted& wanted, Timeout timeout, const What& what) const {
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
  void throw_if_backend_died(const Ready& ready) const {
    // A back-end releases its lock after its last word, so check once more for that word.
    if (mapping_->backend_is_alive() || mapping_->has_ended() || ready()) return;
    // relaxed: see append, which has no time to look itself.
    backend_died_.store(true, std::memory_order_relaxed);
    throw_stopped();
  }

  // The wait itself runs the back-end.
  template <class Ready, class What>
  void run_inline(const Ready& ready, Timeout timeout, const What& what) const {
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

  std::shared_ptr<void> owner_;  // destroyed last, because it contains the inline back-end
  std::shared_ptr<const SessionMapping> mapping_;
  Session session_;
  std::optional<ipc::SharedMemory> action_;
  FrontendOptions options_;
  Backend* inline_backend_;
  std::thread::id thread_;
  std::function<void()> interrupt_;
  ipc::ForkGuard fork_;
  ipc::Ring queue_;
  std::vector<std::uint64_t> queue_entry_;
  TimeIndex last_appended_{-1};
  mutable std::atomic<TimeIndex> handed_out_{-1};
  mutable std::atomic<bool> backend_died_{false};
};

namespace {

// Locks the queue of `mapping` for this process and returns it. Nothing if the session is about to
// end or has just ended: then look for the next one. Throws ControlHeld.
std::optional<ipc::SharedMemory> take_control(const SessionMapping& mapping) {
  std::optional<ipc::SharedMemory> action;
  try {
    action.emplace(mapping.directory()->open(
        detail::action_file(mapping.name(), mapping.header().session_id), ipc::Access::kReadWrite));
  } catch (const SystemError& error) {
    if (error.error_number() == ENOENT) return std::nullopt;
    throw;
  }
  const detail::RingPlace& place = mapping.header().queue;
  // Somebody has truncated the file. The back-end notices that, too.
  if (action->size() < place.offset + place.shape.size()) return std::nullopt;
  auto& header = *reinterpret_cast<detail::ActionHeader*>(action->data());
  // The claim lets one process at a time pass. Its holder sees a lock and the name of the process
  // that holds this lock.
  if (!ipc::try_lock(action->file(), ipc::Lock::kClaim)) return std::nullopt;
  if (!ipc::try_lock(action->file())) {
    // The handle that ended the session still lives. The next session is about to begin.
    if (mapping.has_ended()) return std::nullopt;
    const ipc::ProcessIdentity holder = header.controller();
    if (holder.is_known_dead()) {
      // A child that a bare fork(2) made keeps the lock of its dead parent. Only the next session
      // can be controlled. If this session has begun, the back-end ends it by itself.
      if (mapping.header().phase.load(std::memory_order_acquire) <
          static_cast<std::uint32_t>(detail::Phase::kRunning)) {
        send_request(header, detail::kDetach);
      }
      return std::nullopt;
    }
    const bool is_own = holder == ipc::ProcessIdentity::of_this_process();
    throw ControlHeld("robot '" + mapping.name() + "' is controlled by " +
                      (is_own ? "another handle in this process" : describe(holder)) +
                      "; use observe() to look at it");
  }
  // If a predecessor died after its first action, this session is about to end.
  const ipc::Ring queue(action->data() + place.offset, place.shape);
  // If it died while writing that action, nothing is left: our first action replaces it.
  const TimeIndex first = mapping.header().first_index;
  if (mapping.has_ended() || queue.sequence_in_slot(first) >= ipc::Ring::sequence_of(first) ||
      (header.requests.load(std::memory_order_relaxed) & detail::kEndRequests) != 0) {
    return std::nullopt;
  }
  const auto self = ipc::ProcessIdentity::of_this_process();
  header.controller_start_time.store(self.start_time, std::memory_order_relaxed);
  header.controller_number_space.store(self.number_space, std::memory_order_relaxed);
  // release: a watchdog that sees the number also finds the lock taken.
  header.controller_pid.store(self.pid, std::memory_order_release);
  ipc::unlock(action->file(), ipc::Lock::kClaim);
  return action;
}

// Takes part in the session that `find` returns. If that session is ending, it waits for the next
// one.
template <class Find, class Make>
auto attach(const Find& find, const FrontendOptions& options, const Make& make) {
  const Deadline deadline(options.timeout);
  const Deadline grace(std::min<Timeout>(options.timeout, std::chrono::milliseconds(500)));
  while (true) {
    const Session session = find();
    const std::shared_ptr<const SessionMapping>& mapping = session.mapping();
    if (!options.control || mapping->is_companion()) return make(mapping, std::nullopt);
    if (!mapping->backend_is_alive()) {
      throw SessionNotFound("the back-end of robot '" + mapping->name() + "', process " +
                            std::to_string(mapping->header().backend_pid) +
                            ", is gone; start it again with 'trifinger run'");
    }
    // A user who was killed leaves the fault of a late action. The back-end clears that fault by
    // itself.
    const bool may_clear = mapping->fault().code == Fault::Code::kActionLate && !grace.passed();
    if (mapping->has_ended() && mapping->fault().needs_recovery() && !may_clear) {
      throw RobotStopped(mapping->fault(), "robot '" + mapping->name() +
                                               "' has stopped: " + mapping->fault_text() +
                                               "; clear this with recover() when it is safe");
    }
    std::optional<ipc::SharedMemory> action = take_control(*mapping);
    if (action) return make(mapping, std::move(action));
    if (deadline.passed()) {
      throw TimedOut("robot '" + mapping->name() +
                     "' has not begun a new session in time; if this lasts, 'trifinger stop " +
                     mapping->name() + "' ends its back-end");
    }
    std::this_thread::sleep_for(kPollPeriod);
  }
}

}  // namespace

UntypedFrontend::UntypedFrontend(std::unique_ptr<Implementation> implementation)
    : implementation_(std::move(implementation)) {}

UntypedFrontend::UntypedFrontend(const std::string& name, FrontendOptions options)
    : implementation_(attach([&] { return Session::open(name); }, options,
                             [&](auto mapping, auto action) {
                               return std::make_unique<Implementation>(
                                   std::move(mapping), std::move(action), options, nullptr);
                             })) {}

UntypedFrontend::UntypedFrontend(const SessionHost& host, FrontendOptions options)
    : implementation_(attach(
          [&] {
            const Deadline deadline(options.timeout);
            while (true) {
              try {
                return host.open();
              } catch (const SessionNotFound&) {
                if (deadline.passed()) throw;
              }
              std::this_thread::sleep_for(kPollPeriod);
            }
          },
          options,
          [&](auto mapping, auto action) {
            return std::make_unique<Implementation>(std::move(mapping), std::move(action), options,
                                                    nullptr);
          })) {}

UntypedFrontend::UntypedFrontend(const Session& session)
    : implementation_(std::make_unique<Implementation>(
          session.mapping(), std::nullopt, FrontendOptions{.control = false}, nullptr)) {}

UntypedFrontend::UntypedFrontend(Backend& backend, FrontendOptions options,
                                 std::shared_ptr<void> owner)
    : implementation_(attach(
          [&] {
            if (backend.options().mode != BackendOptions::Mode::kNonRealTime) {
              throw InvalidArgument(
                  "a back-end in real-time mode cannot run inline: it must do one step per period");
            }
            backend.begin_session();
            return backend.host().open();
          },
          options,
          [&](auto mapping, auto action) {
            return std::make_unique<Implementation>(std::move(mapping), std::move(action), options,
                                                    &backend, std::move(owner));
          })) {}

UntypedFrontend::UntypedFrontend(UntypedFrontend&&) noexcept = default;
UntypedFrontend& UntypedFrontend::operator=(UntypedFrontend&&) noexcept = default;
UntypedFrontend::~UntypedFrontend() = default;

TimeIndex UntypedFrontend::append_desired_action(const void* action, Timeout timeout) {
  return implementation_->append(action, timeout);
}
TimeIndex UntypedFrontend::append_desired_actions(const void* actions, std::size_t count,
                                                  Timeout timeout) {
  return implementation_->append(actions, count, timeout);
}
void UntypedFrontend::get(Series series, TimeIndex t, void* element, Timeout timeout) const {
  implementation_->get(series, t, element, timeout);
}
void UntypedFrontend::get(Series series, TimeIndex first, std::size_t count, void* elements,
                          Timeout timeout) const {
  implementation_->get(series, first, count, elements, timeout);
}
bool UntypedFrontend::try_get(Series series, TimeIndex t, void* element) const {
  return implementation_->try_get(series, t, element);
}
void UntypedFrontend::wait_until_time_index(TimeIndex t, Timeout timeout) const {
  implementation_->wait_for(Series::kObservation, t, timeout);
}
void UntypedFrontend::latest_observation(void* observation, Timeout timeout) const {
  implementation_->latest_observation(observation, timeout);
}
bool UntypedFrontend::get_latest_at(TimeIndex t, void* element, Timeout timeout) const {
  return implementation_->get_latest_at(t, element, timeout);
}
TimeIndex UntypedFrontend::current_time_index() const {
  return implementation_->current_time_index();
}
std::pair<TimeIndex, TimeIndex> UntypedFrontend::range(Series series) const {
  return implementation_->range(series);
}
std::optional<Fault> UntypedFrontend::fault() const { return implementation_->fault(); }
void UntypedFrontend::finish(Timeout timeout) { implementation_->finish(timeout); }
void UntypedFrontend::recover(Timeout timeout) { implementation_->recover(timeout); }
UntypedFrontend UntypedFrontend::companion(const std::string& name) const {
  return UntypedFrontend(implementation_->companion(name));
}
const Session& UntypedFrontend::session() const { return implementation_->session(); }
void UntypedFrontend::set_interrupt(std::function<void()> interrupt) {
  implementation_->set_interrupt(std::move(interrupt));
}

namespace {

void require_same(const std::string& what, const ElementDescription& found,
                  const ElementDescription& expected) {
  if (found == expected) return;
  const std::string found_text = found.text();
  throw IncompatibleSession(what + " has other fields than this program expects.\nSession:\n" +
                            found_text + "Program:\n" + expected.text() +
                            "Build both from the same version.");
}

}  // namespace

void require_same_robot(const Session& session, const RobotTypes& expected) {
  const RobotTypes& found = session.description();
  const std::string name = "session '" + session.info().name + "'";
  if (found.type != expected.type) {
    throw IncompatibleSession(name + " is a robot of type '" + found.type +
                              "'; this program expects '" + expected.type + "'");
  }
  require_same("the action of " + name, found.action, expected.action);
  require_same("the applied action of " + name, found.applied_action, expected.applied_action);
  require_same("the observation of " + name, found.observation, expected.observation);
}

void require_same_companion(const Session& session, const ElementDescription& expected) {
  require_same("session '" + session.info().name + "'", session.description().observation,
               expected);
}

}  // namespace trifinger
