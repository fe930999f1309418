// SPDX-License-Identifier: BSD-3-Clause
#include "session_reader.hpp"

#include <algorithm>
#include <cstring>
#include <string>

#include "trifinger/base/error.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/ipc/ring.hpp"

namespace trifinger::detail {

bool SessionReader::try_get(Series series, TimeIndex t, void* element) const {
  handle_.require_own();
  if (t < mapping_.header().first_index) {
    throw InvalidArgument("step " + std::to_string(t) + " does not exist; steps begin at " +
                          std::to_string(mapping_.header().first_index));
  }
  if (!mapping_.has(series)) static_cast<void>(mapping_.element(series));  // throws
  switch (mapping_.ring(series).read(t, element)) {
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

void SessionReader::get(Series series, TimeIndex t, void* element, Timeout timeout) const {
  if (try_get(series, t, element)) return;
  wait_for(series, t, timeout);
  // The element was there a moment ago. If not found, the writer is now a whole history further.
  if (!try_get(series, t, element)) throw_lost(series, t);
}

void SessionReader::get(Series series, TimeIndex first, std::size_t count, void* elements,
                        Timeout timeout) const {
  if (count == 0) return;
  const std::size_t size = mapping_.element(series).size();
  const auto capacity = mapping_.ring(series).shape().capacity;
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

void SessionReader::wait_for(Series series, TimeIndex t, Timeout timeout) const {
  handle_.require_own();
  const auto kind = series == Series::kObservation ? Wanted::kObservation : Wanted::kStep;
  handle_.wait([this, series, t] { return mapping_.end_of(series) > t; }, {kind, t}, timeout,
               [series, t] {
                 return "step " + std::to_string(t) + " of " + std::string(name_of(series));
               });
}

void SessionReader::latest_observation(void* observation, Timeout timeout) const {
  handle_.require_own();
  const auto is_read = [&] { return read_latest_observation(observation); };
  if (is_read()) return;
  handle_.wait(is_read, {Wanted::kAnything, 0}, timeout,
               [] { return std::string("an observation"); });
}

bool SessionReader::read_latest_observation(void* observation) const {
  // The writer may overtake us by a whole history between the two calls; then there is a newer
  // observation.
  while (true) {
    const TimeIndex end = mapping_.end_of(Series::kObservation);
    const Series series = end > mapping_.header().first_index || !mapping_.has(Series::kHolding)
                              ? Series::kObservation
                              : Series::kHolding;
    const TimeIndex newest = mapping_.end_of(series) - 1;
    if (newest < 0) return false;
    if (mapping_.ring(series).read(newest, observation) != ipc::ReadResult::kDone) {
      if (mapping_.end_of(series) - 1 == newest) return false;  // damaged
      continue;
    }
    if (series == Series::kObservation) hand_out(newest);
    return true;
  }
}

bool SessionReader::get_latest_at(TimeIndex t, void* element, Timeout timeout) const {
  handle_.require_own();
  if (!mapping_.is_companion()) {
    throw InvalidArgument("get_latest_at reads companions; robot '" + mapping_.name() +
                          "' has one element per step: use get_observation");
  }
  const auto is_complete = [this, t] {
    // acquire: all elements of that step were written before.
    return mapping_.header().complete_through.load(std::memory_order_acquire) >= t;
  };
  if (!is_complete()) {
    handle_.wait(is_complete, {Wanted::kAnything, t}, timeout,
                 [t] { return "step " + std::to_string(t) + " of the robot"; });
  }
  const ipc::Ring& ring = mapping_.ring(Series::kObservation);
  TimeIndex oldest = t + 1;
  for (TimeIndex i = mapping_.end_of(Series::kObservation) - 1; i >= 0; --i) {
    if (ring.read(i, element) != ipc::ReadResult::kDone) throw HistoryLost(t, oldest);
    // The caller's buffer may not be aligned.
    Stamp stamp;
    std::memcpy(&stamp, element, sizeof(stamp));
    if (stamp.arrival_index <= t) return true;
    oldest = stamp.arrival_index;
  }
  return false;
}

TimeIndex SessionReader::current_time_index() const {
  handle_.require_own();
  return mapping_.end_of(Series::kObservation) - 1;
}

std::pair<TimeIndex, TimeIndex> SessionReader::range(Series series) const {
  const TimeIndex end = mapping_.end_of(series);
  const auto capacity = static_cast<TimeIndex>(mapping_.ring(series).shape().capacity);
  return {std::max(mapping_.begin_of(series), end - capacity), end};
}

std::optional<Fault> SessionReader::fault() const {
  handle_.require_own();
  const bool is_inline = handle_.inline_backend() != nullptr;
  if (mapping_.has_ended() || (!is_inline && !mapping_.backend_is_alive())) return mapping_.fault();
  return std::nullopt;
}

void SessionReader::hand_out(TimeIndex t) const noexcept {
  // relaxed: see handed_out. Several readers may race here. Only the newest step counts, and an
  // error of one step does not matter.
  if (t > handed_out_.load(std::memory_order_relaxed)) {
    handed_out_.store(t, std::memory_order_relaxed);
  }
}

void SessionReader::throw_lost(Series series, TimeIndex t) const {
  // The writer may be overwriting the slot of t and count it only later.
  throw HistoryLost(t, std::max(t + 1, range(series).first));
}

}  // namespace trifinger::detail
