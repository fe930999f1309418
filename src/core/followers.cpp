// SPDX-License-Identifier: BSD-3-Clause
#include "followers.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>

#include "trifinger/base/error.hpp"
#include "trifinger/core/payload.hpp"

namespace trifinger::detail {

void Followers::begin_session(const SessionHost& host, const SessionPlace::Writers& writers) {
  if (followers_.empty()) return;
  // Observations come first: they are published before their step is complete.
  capacity_ = writers.robot->capacity_of(Series::kObservation);
  next_look_ = capacity_;
  companions_.clear();
  for (Entry& entry : followers_) entry = {.follower = entry.follower};
  std::optional<Session> robot;
  std::vector<Session> companions;
  try {
    robot = host.open();
    for (const std::string& name : robot->companion_names()) {
      companions.push_back(robot->companion(name));
    }
  } catch (const Error&) {
    // Somebody has just removed or truncated the session. Nobody follows it, and the loop handles
    // the rest.
    return;
  }
  for (std::size_t i = 0; i < writers.companions.size(); ++i) {
    const SessionWriter* const writer = writers.companions[i].get();
    TimeIndex capacity = writer->capacity_of(Series::kObservation);
    // Payloads are overwritten sooner than their elements.
    constexpr TimeIndex kPayloads = PayloadWriter::kDefaultHistory;
    if (companions[i].payload().size() > 0) capacity = std::min(capacity, kPayloads);
    companions_.push_back({.writer = writer, .capacity = capacity});
  }
  for (Entry& entry : followers_) {
    entry.has_joined = true;
    entry.follower->begin_session(*robot, companions);
  }
}

// The elements are in the order of their arrival.
TimeIndex Followers::FollowedCompanion::first_element_at(TimeIndex step) const noexcept {
  // Elements that arrived before step 0 belong to step 0.
  if (step <= 0) return 0;
  const TimeIndex end = writer->end_of(Series::kObservation);
  TimeIndex first = std::max<TimeIndex>(0, end - capacity);
  TimeIndex last = end;
  while (first < last) {
    const TimeIndex middle = first + (last - first) / 2;
    if (writer->arrival_index(middle) < step) {
      first = middle + 1;
    } else {
      last = middle;
    }
  }
  return first;
}

bool Followers::blocks(TimeIndex next_step, TimeIndex t) const noexcept {
  return t - next_step >= capacity_ ||
         std::ranges::any_of(companions_, [next_step](const FollowedCompanion& companion) {
           return !companion.has_room_from(companion.first_element_at(next_step));
         });
}

bool Followers::look(TimeIndex t, TimeIndex margin) noexcept {
  TimeIndex room_end = t + capacity_;
  bool is_someone_given_up = false;
  for (FollowedCompanion& companion : companions_) {
    companion.first_unread = companion.writer->end_of(Series::kObservation);
  }
  for (Entry& entry : followers_) {
    if (!entry.has_joined) continue;
    const TimeIndex next = std::min(entry.follower->next_step(), t);
    if (entry.is_given_up && blocks(next, t)) {
      is_someone_given_up = true;
      continue;
    }
    entry.is_given_up = false;
    room_end = std::min(room_end, next + capacity_);
    for (FollowedCompanion& companion : companions_) {
      companion.first_unread = std::min(companion.first_unread, companion.first_element_at(next));
    }
  }
  next_look_ = is_someone_given_up ? t + 1 : room_end;
  return t + margin < room_end && std::ranges::all_of(companions_, &FollowedCompanion::has_room);
}

void Followers::wait(TimeIndex t) noexcept {
  constexpr auto kNap = std::chrono::microseconds(100);
  constexpr Nanoseconds kSlice = std::chrono::milliseconds(50);
  const Instant begin = std::chrono::steady_clock::now();
  Instant before = begin;
  // Wait until there is room for several steps. Otherwise back-end and follower would wake each
  // other in every step.
  while (!look(t, capacity_ / 4)) {
    const Instant now = std::chrono::steady_clock::now();
    for (Entry& entry : followers_) {
      const TimeIndex next = entry.follower->next_step();
      entry.waited = next == entry.seen_step ? entry.waited + (now - before) : Nanoseconds::zero();
      entry.seen_step = next;
      if (entry.waited >= max_wait_ && blocks(next, t)) entry.is_given_up = true;
    }
    before = now;
    if (now - begin >= kSlice) return;
    std::this_thread::sleep_for(kNap);
  }
}

}  // namespace trifinger::detail
