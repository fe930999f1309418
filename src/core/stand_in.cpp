// SPDX-License-Identifier: BSD-3-Clause
#include "stand_in.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <stop_token>
#include <utility>

#include "ipc/futex.hpp"
#include "ipc/ring.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/status.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::detail {
namespace {

// A short delay disturbs little: the last action acts on for so long before the robot is held.
// Later, so much is queued ahead of the robot that a busy machine may delay this thread.
constexpr Nanoseconds kGrace = std::chrono::milliseconds(10);
// A thread looks whether it shall end, and whether the back-end lives, at least this often.
constexpr Nanoseconds kLook = std::chrono::milliseconds(20);

}  // namespace

StandIn::StandIn(FrontendState& state)
    : state_(state),
      capacity_(static_cast<TimeIndex>(state.queue.shape().capacity)),
      grace_(std::clamp<TimeIndex>(kGrace.count() / state.header().period, 1, capacity_ / 2)),
      observation_(state.mapping->element(Series::kObservation).size()),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

void StandIn::set(OnLate on_late, HoldAction hold) {
  {
    const std::lock_guard lock(mutex_);
    on_late_ = on_late;
    hold_ = std::move(hold);
  }
  changed_.notify_all();
}

bool StandIn::is_late() const {
  const std::lock_guard lock(mutex_);
  return appended_ > 0;
}

std::unique_lock<std::mutex> StandIn::turn() {
  std::unique_lock lock(mutex_);
  appended_ = 0;
  is_held_ = false;
  return lock;
}

void StandIn::work(const std::stop_token& stop) {
  // On any processor, and below the back-end's priority. What costs memory or power is for the
  // program to decide.
  leave_realtime();
  static_cast<void>(
      enter_realtime({.priority = 70, .lock_memory = false, .heap = 0, .keep_cpus_awake = false}));
  // Of each period the program has this much to append the next action.
  const Nanoseconds patience = Nanoseconds(state_.header().period) * 9 / 10;
  // The first action begins the session.
  if (!wait_for_observation(state_.header().first_index, stop)) return;
  std::unique_lock lock(mutex_);
  const auto is_on = [this] { return on_late_ != OnLate::kNothing; };
  while (changed_.wait(lock, stop, is_on) && !stop.stop_requested()) {
    const TimeIndex last = state_.last_appended;
    // It grows with the delay, so that the program's next action is not much later than it was.
    const TimeIndex ahead = std::min(appended_, grace_);
    lock.unlock();
    if (!wait_for_observation(last - ahead / 2, stop)) return;
    lock.lock();
    const auto is_outdated = [&] { return state_.last_appended != last || !is_on(); };
    if (is_outdated()) continue;
    if (appended_ == 0) {
      // The observation came some time after the step had begun.
      const Instant begun = std::min(begin_of(last), std::chrono::steady_clock::now());
      if (changed_.wait_until(lock, stop, begun + patience, is_outdated)) continue;
    }
    if (!stop.stop_requested()) append(std::max<TimeIndex>(ahead, 1));
  }
}

Instant StandIn::begin_of(TimeIndex t) const {
  Status status;
  const ipc::Ring& ring = state_.mapping->ring(Series::kStatus);
  if (ring.read(t, &status) != ipc::ReadResult::kDone) return Instant::max();
  return Instant(Nanoseconds(status.time));
}

bool StandIn::wait_for_observation(TimeIndex t, const std::stop_token& stop) const {
  const SessionMapping& mapping = *state_.mapping;
  const auto& word = state_.header().event;
  Deadline look(kLook);
  while (mapping.end_of(Series::kObservation) <= t) {
    // seq_cst: the wait slot comes after it, see SessionWriter::announce.
    const std::uint32_t event = word.load(std::memory_order_seq_cst);
    if (stop.stop_requested() || mapping.has_ended()) return false;
    if (look.passed()) {
      if (!mapping.backend_is_alive()) return false;
      look = Deadline(kLook);
    }
    const WaitSlot slot(state_.action_header(), {Wanted::kObservation, t});
    if (mapping.end_of(Series::kObservation) <= t && word.load(std::memory_order_seq_cst) == event)
      ipc::futex_wait(word, event, kLook);
  }
  return true;
}

void StandIn::append(TimeIndex ahead) {
  const TimeIndex newest = state_.mapping->end_of(Series::kObservation) - 1;
  state_.queue_entry[0] = 0;  // The rest is still the last action.
  do {
    // acquire: the slots of indices taken before are free.
    const TimeIndex open = state_.header().next_action.load(std::memory_order_acquire);
    const TimeIndex t = std::max(state_.last_appended + 1, open);
    if (t - open >= capacity_) return;
    const bool shall_hold = on_late_ == OnLate::kHold && appended_ >= grace_;
    if (shall_hold && !is_held_) is_held_ = make_hold_action(newest);
    // If the back-end closes this step just now, the next action comes in time.
    state_.put(t);
    ++appended_;
  } while (state_.last_appended - newest < ahead);
}

bool StandIn::make_hold_action(TimeIndex newest) {
  const SessionMapping& mapping = *state_.mapping;
  if (mapping.ring(Series::kObservation).read(newest, observation_.data()) !=
      ipc::ReadResult::kDone) {
    return false;  // A newer one is there.
  }
  const std::vector<std::byte>& action = mapping.description().default_action;
  std::memcpy(state_.queue_entry.data() + 1, action.data(), action.size());
  hold_(observation_.data(), state_.queue_entry.data() + 1);
  return true;
}

}  // namespace trifinger::detail
