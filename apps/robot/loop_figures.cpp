// SPDX-License-Identifier: BSD-3-Clause
#include "robot/loop_figures.hpp"

#include <chrono>
#include <cstring>
#include <vector>

namespace trifinger::apps {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::int64_t monotonic_now() {
  return std::chrono::steady_clock::now().time_since_epoch() / Nanoseconds(1);
}

}  // namespace

void LoopFigures::update(const UntypedFrontend& session) {
  const SessionInfo info = session.session().info();
  if (info.session_id != session_id_) {
    *this = LoopFigures();
    session_id_ = info.session_id;
    if (session.session().element(Series::kStatus) != describe<Status>()) {
      throw IncompatibleSession("session '" + info.name +
                                "' is of another version: its statuses have other fields");
    }
    first_ = next_ = session.range(Series::kStatus).first;
  }

  const TimeIndex end = session.range(Series::kStatus).second;
  while (next_ < end) {
    Status status;
    try {
      if (!session.try_get(Series::kStatus, next_, &status)) break;
      take(next_, status, info.period);
      ++next_;
    } catch (const HistoryLost& lost) {
      // A fast back-end overwrites steps while we read them, so continue well ahead of the oldest
      // one.
      next_ = lost.oldest() + (end - lost.oldest()) / 4 + 1;
    }
  }

  const bool goes_on = info.backend_is_alive && (newest_.flags & Status::kEnd) == 0;
  now_ = goes_on ? monotonic_now() : newest_.time;
  while (!recent_.empty() && recent_.front().time < now_ - kSecond) recent_.pop_front();
}

void LoopFigures::take(TimeIndex t, const Status& status, Nanoseconds period) {
  newest_ = status;
  // The last status of a session only says why it ended.
  if ((status.flags & Status::kEnd) != 0) return;
  const Step step{.time_index = t,
                  .time = status.time,
                  .lateness = lateness_of(status, period),
                  .flags = status.flags,
                  .skipped_ticks = status.skipped_ticks};
  total_.add(step.flags, step.skipped_ticks);
  recent_.push_back(step);
  while (recent_.front().time < status.time - kSecond) recent_.pop_front();
}

double LoopFigures::rate() const {
  if (recent_.size() < 2) return 0.0;
  // Uses the indices: some steps of a fast back-end disappear before they can be read.
  const TimeIndex steps = recent_.back().time_index - recent_.front().time_index;
  const std::int64_t step = (recent_.back().time - recent_.front().time) / steps;
  // The second ends with the last step. It ends now if the next step is overdue.
  const bool is_overdue = now_ - recent_.back().time > 2 * step + kSecond / 20;
  const std::int64_t end = is_overdue ? now_ : recent_.back().time;
  return static_cast<double>(steps) * 1e9 / static_cast<double>(end - recent_.front().time);
}

LatenessHistogram LoopFigures::lateness() const {
  LatenessHistogram lateness;
  for (const Step& step : recent_) lateness.add(step.lateness);
  return lateness;
}

StepCounts LoopFigures::last_second() const {
  StepCounts counts;
  for (const Step& step : recent_) counts.add(step.flags, step.skipped_ticks);
  return counts;
}

double arrival_rate(const UntypedFrontend& companion) {
  const ElementDescription& description = companion.session().element(Series::kObservation);
  const FieldDescription* const arrival = description.find("stamp.arrival_time");
  if (arrival == nullptr || arrival->type != ScalarType::kInt64) return 0.0;

  const std::int64_t now = monotonic_now();
  std::vector<std::byte> element(description.size());
  std::int64_t count = 0;
  std::int64_t oldest_time = now;
  const auto [first, end] = companion.range(Series::kObservation);
  for (TimeIndex i = end - 1; i >= first; --i) {
    try {
      if (!companion.try_get(Series::kObservation, i, element.data())) break;
    } catch (const HistoryLost&) {
      break;
    }
    std::int64_t time = 0;
    std::memcpy(&time, element.data() + arrival->offset, sizeof(time));
    if (time < now - kSecond) return static_cast<double>(count);
    oldest_time = time;
    ++count;
  }
  // All elements in the history arrived within less than a second.
  return count < 2 ? 0.0
                   : static_cast<double>(count) * 1e9 / static_cast<double>(now - oldest_time);
}

}  // namespace trifinger::apps
