// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "base/moved.hpp"
#include "frontend_state.hpp"
#include "ipc/futex.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "stand_in.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/status.hpp"

namespace trifinger {
namespace {

using detail::Wanted;

// True if the action appended for `t` was applied; false if it came too late. The back-end has
// already passed `t`.
bool was_taken(const UntypedFrontend& frontend, const detail::FrontendState& state, TimeIndex t) {
  Status status;
  try {
    // The user's timeout does not apply: the action is on its way, and the back-end is just now
    // doing the tick that decides.
    frontend.get(Series::kStatus, t, &status, kForever);
  } catch (const HistoryLost&) {
    return false;
  }
  if ((status.flags & Status::kEnd) != 0) state.throw_stopped();
  return (status.flags & Status::kActionRepeated) == 0;
}

void wait_for_queue_space(const detail::FrontendState& state, TimeIndex taken, Timeout timeout) {
  state.wait([&] { return state.header().next_action.load(std::memory_order_acquire) > taken; },
             {Wanted::kQueueSpace, taken}, timeout,
             [] { return std::string("a free place in the queue of actions"); });
}

}  // namespace

TimeIndex UntypedFrontend::append_desired_action(const void* action, Timeout timeout) {
  detail::FrontendState& state = *checked(state_);
  state.require_own();
  state.require_control();
  if (state.inline_backend != nullptr && !state.inline_thread->take()) state.throw_moved();
  const detail::StateHeader& header = state.header();
  while (true) {
    auto turn = detail::StandIn::turn_of(state);
    // relaxed: no other data depends on this flag.
    const bool has_died = state.backend_died.load(std::memory_order_relaxed);
    if (has_died || state.mapping->has_ended()) state.throw_stopped();
    // acquire: the slots of indices taken before are free.
    const TimeIndex open = header.next_action.load(std::memory_order_acquire);
    const TimeIndex t = std::max(state.last_appended + 1, open);
    const auto capacity = static_cast<TimeIndex>(state.queue.shape().capacity);
    if (t - open >= capacity) {
      turn = {};
      wait_for_queue_space(state, t - capacity, timeout);
      continue;
    }
    // relaxed: this thread set it, or a thread whose read has no fixed order with this append.
    const bool is_acausal = t <= state.handed_out.load(std::memory_order_relaxed);
    if (is_acausal && state.is_strict) throw AcausalAction(t);

    state.queue_entry[0] = is_acausal ? detail::QueueFlags::kAcausal : 0;
    std::memcpy(state.queue_entry.data() + 1, action, state.queue.shape().element_size - 8);
    state.put(t);
    turn = {};
    // seq_cst: a back-end that closes t says so before it looks for the action once more. If t is
    // not closed here, the back-end will find the action.
    if (header.is_real_time == 0 || header.next_action.load(std::memory_order_seq_cst) <= t ||
        was_taken(*this, state, t)) {
      return t;
    }
  }
}

void UntypedFrontend::set_on_late(OnLate on_late, HoldAction hold) {
  detail::FrontendState& state = *checked(state_);
  state.require_own();
  state.require_control();
  if (on_late == OnLate::kHold && !hold) {
    throw InvalidArgument("OnLate::kHold needs a function that makes the action");
  }
  if (state.header().is_real_time == 0) return;
  if (!state.stand_in && on_late == OnLate::kNothing) return;
  if (!state.stand_in) state.stand_in = std::make_unique<detail::StandIn>(state);
  state.stand_in->set(on_late, std::move(hold));
}

bool UntypedFrontend::is_late() const {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  return state.stand_in && state.stand_in->is_late();
}

TimeIndex UntypedFrontend::append_desired_actions(const void* actions, std::size_t count,
                                                  Timeout timeout) {
  if (count == 0) throw InvalidArgument("a burst needs at least one action");
  const std::size_t size = checked(state_)->mapping->description().action.size();
  TimeIndex t = -1;
  for (std::size_t i = 0; i < count; ++i) {
    t = append_desired_action(static_cast<const std::byte*>(actions) + i * size, timeout);
  }
  return t;
}

void UntypedFrontend::finish(Timeout timeout) {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  state.require_control();
  if (state.inline_backend != nullptr && !state.inline_thread->take()) {
    state.throw_moved();
  }
  const detail::SessionMapping& mapping = *state.mapping;
  const bool has_ended = mapping.has_ended();
  if (!has_ended) detail::send_request(*state.action_header(), detail::kFinish);
  // Only now, so that no step is without an action before the back-end knows that it is the end.
  if (state.stand_in) state.stand_in->set(OnLate::kNothing, {});
  if (!has_ended) {
    state.wait([&mapping] { return mapping.has_ended(); }, {Wanted::kAnything, 0}, timeout,
               [] { return std::string("the end of the session"); });
    state.run_inline_to_end();
  }
  // The session may have ended before the request, for a reason that left some actions unused.
  const Fault fault = mapping.fault();
  const bool is_as_good =
      fault.code == Fault::Code::kExhausted && state.last_appended < fault.time_index;
  if (fault.code != Fault::Code::kFinished && !is_as_good) state.throw_stopped();
}

void UntypedFrontend::recover(Timeout timeout) {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  if (state.inline_backend != nullptr) {
    using detail::InlineThread;
    state.require_backend();
    const InlineThread::Use use(*state.inline_thread, InlineThread::Taking::kYes);
    if (!use) state.throw_moved();
    state.inline_backend->recover();
    return;
  }
  const detail::SessionMapping& mapping = *state.mapping;
  if (!mapping.has_ended()) {
    if (!mapping.backend_is_alive()) mapping.throw_stopped();
    return;
  }
  state.require_control();
  detail::send_request(*state.action_header(), detail::kRecover);
  detail::wait_for_next_session(mapping, timeout, state.interrupt);
}

}  // namespace trifinger
