// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "base/moved.hpp"
#include "frontend_state.hpp"
#include "ipc/ring.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/payload.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger {
namespace {

using detail::SessionMapping;
using detail::Wanted;

// The index after t; the largest has none.
TimeIndex next(TimeIndex t) noexcept {
  return t < std::numeric_limits<TimeIndex>::max() ? t + 1 : t;
}

TimeIndex first_in_history(const SessionMapping& mapping, Series series) {
  const auto capacity = static_cast<TimeIndex>(mapping.ring(series).shape().capacity);
  return std::max(mapping.begin_of(series), mapping.end_of(series) - capacity);
}

[[noreturn]] void throw_lost(const SessionMapping& mapping, Series series, TimeIndex t) {
  // The writer may be overwriting the slot of t and count it only later.
  throw HistoryLost(t, std::max(next(t), first_in_history(mapping, series)));
}

// The last of `count` steps. Throws InvalidArgument if no step has this index.
TimeIndex last_of(TimeIndex first, std::size_t count) {
  const auto more = static_cast<TimeIndex>(count - 1);
  if (first <= std::numeric_limits<TimeIndex>::max() - more) return first + more;
  throw InvalidArgument(std::to_string(count) + " steps from step " + std::to_string(first) +
                        " on reach beyond the last index there is");
}

// Remembers that the user knows y_t.
void hand_out(const detail::FrontendState& state, TimeIndex t) noexcept {
  // relaxed: see append_desired_action. Several readers may race here. Only the newest step counts,
  // and an error of one step does not matter.
  if (t > state.handed_out.load(std::memory_order_relaxed)) {
    state.handed_out.store(t, std::memory_order_relaxed);
  }
}

// False if there is no observation yet.
bool read_latest_observation(const detail::FrontendState& state, void* observation) {
  const SessionMapping& mapping = *state.mapping;
  // The writer may overtake us by a whole history between the two calls; then there is a newer
  // observation.
  while (true) {
    const TimeIndex end = mapping.end_of(Series::kObservation);
    const Series series = end > state.header().first_index || !mapping.has(Series::kHolding)
                              ? Series::kObservation
                              : Series::kHolding;
    const TimeIndex newest = mapping.end_of(series) - 1;
    if (newest < 0) return false;
    if (mapping.ring(series).read(newest, observation) != ipc::ReadResult::kDone) {
      if (mapping.end_of(series) - 1 == newest) return false;  // damaged
      continue;
    }
    if (series == Series::kObservation) hand_out(state, newest);
    return true;
  }
}

void wait_for(const detail::FrontendState& state, Series series, TimeIndex t, Timeout timeout) {
  const auto kind = series == Series::kObservation ? Wanted::kObservation : Wanted::kStep;
  state.wait(
      [&, series, t] { return state.mapping->end_of(series) > t; }, {kind, t}, timeout,
      [series, t] { return "step " + std::to_string(t) + " of " + std::string(name_of(series)); });
}

}  // namespace

bool UntypedFrontend::try_get(Series series, TimeIndex t, void* element) const {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  const SessionMapping& mapping = *state.mapping;
  if (t < mapping.header().first_index) {
    throw InvalidArgument("step " + std::to_string(t) + " does not exist; steps begin at " +
                          std::to_string(mapping.header().first_index));
  }
  if (!mapping.has(series)) static_cast<void>(mapping.element(series));  // throws
  // A ring has no number for the largest index, so its slot would look filled.
  if (t == std::numeric_limits<TimeIndex>::max()) return false;
  switch (mapping.ring(series).read(t, element)) {
    case ipc::ReadResult::kDone:
      if (series == Series::kObservation) hand_out(state, t);
      return true;
    case ipc::ReadResult::kLost:
      throw_lost(mapping, series, t);
    case ipc::ReadResult::kNotYet:
      break;
  }
  return false;
}

void UntypedFrontend::get(Series series, TimeIndex t, void* element, Timeout timeout) const {
  if (try_get(series, t, element)) return;
  wait_for(*state_, series, t, timeout);
  // The element was there a moment ago. If not found, the writer is now a whole history further.
  if (!try_get(series, t, element)) throw_lost(*checked(state_)->mapping, series, t);
}

void UntypedFrontend::get(Series series, TimeIndex first, std::size_t count, void* elements,
                          Timeout timeout) const {
  if (count == 0) return;
  const SessionMapping& mapping = *checked(state_)->mapping;
  const std::size_t size = mapping.element(series).size();
  const auto capacity = mapping.ring(series).shape().capacity;
  if (count > capacity) {
    throw InvalidArgument(std::to_string(count) +
                          " steps at once are more than the history keeps (" +
                          std::to_string(capacity) + ")");
  }
  const TimeIndex last = last_of(first, count);
  auto* target = static_cast<std::byte*>(elements);
  // The last element is read first: if it exists, all exist.
  get(series, last, target + (count - 1) * size, timeout);
  for (std::size_t i = 0; i + 1 < count; ++i) {
    const TimeIndex t = first + static_cast<TimeIndex>(i);
    if (!try_get(series, t, target + i * size)) throw_lost(mapping, series, t);
  }
}

void UntypedFrontend::wait_until_time_index(TimeIndex t, Timeout timeout) const {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  wait_for(state, Series::kObservation, t, timeout);
}

void UntypedFrontend::latest_observation(void* observation, Timeout timeout) const {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  const auto is_read = [&] { return read_latest_observation(state, observation); };
  if (is_read()) return;
  state.wait(is_read, {Wanted::kAnything, 0}, timeout,
             [] { return std::string("an observation"); });
}

bool UntypedFrontend::get_latest_at(TimeIndex t, void* element, Timeout timeout) const {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  const SessionMapping& mapping = *state.mapping;
  if (!mapping.is_companion()) {
    throw InvalidArgument("get_latest_at reads companions; robot '" + mapping.name() +
                          "' has one element per step: use get_observation");
  }
  const auto is_complete = [&mapping, t] {
    // acquire: all elements of that step were written before.
    return mapping.header().complete_through.load(std::memory_order_acquire) >= t;
  };
  if (!is_complete()) {
    state.wait(is_complete, {Wanted::kAnything, t}, timeout,
               [t] { return "step " + std::to_string(t) + " of the robot"; });
  }
  const ipc::Ring& ring = mapping.ring(Series::kObservation);
  TimeIndex oldest = next(t);
  for (TimeIndex i = mapping.end_of(Series::kObservation) - 1; i >= 0; --i) {
    if (ring.read(i, element) != ipc::ReadResult::kDone) throw HistoryLost(t, oldest);
    // The caller's buffer may not be aligned.
    Stamp stamp;
    std::memcpy(&stamp, element, sizeof(stamp));
    if (stamp.arrival_index <= t) return true;
    oldest = stamp.arrival_index;
  }
  return false;
}

PayloadView UntypedFrontend::payload(const void* element) const {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  if (state.payloads == nullptr) {
    throw InvalidArgument("the elements of '" + state.mapping->name() + "' have no payloads");
  }
  PayloadReference reference;
  // The caller's buffer may not be aligned.
  std::memcpy(&reference, static_cast<const std::byte*>(element) + sizeof(Stamp),
              sizeof(reference));
  return state.payloads->view(reference);
}

TimeIndex UntypedFrontend::current_time_index() const {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  return state.mapping->end_of(Series::kObservation) - 1;
}

std::pair<TimeIndex, TimeIndex> UntypedFrontend::range(Series series) const {
  const SessionMapping& mapping = *checked(state_)->mapping;
  const TimeIndex first = first_in_history(mapping, series);
  return {first, mapping.end_of(series)};
}

std::optional<Fault> UntypedFrontend::fault() const {
  const detail::FrontendState& state = *checked(state_);
  state.require_own();
  const SessionMapping& mapping = *state.mapping;
  const bool is_inline = state.inline_backend != nullptr;
  if (mapping.has_ended() || (!is_inline && !mapping.backend_is_alive())) return mapping.fault();
  return std::nullopt;
}

}  // namespace trifinger
