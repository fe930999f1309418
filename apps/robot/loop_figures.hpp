// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>

#include "shared/step_counts.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/timing.hpp"

namespace trifinger::apps {

// Figures about a session's loop, computed from its statuses. Waits for nothing and disturbs
// nobody.
class LoopFigures {
 public:
  // Reads the statuses that were added since the last call; at the first call, the whole history.
  // If `session` is another one than before, the figures start over.
  // @throws IncompatibleSession if another version has written the statuses
  void update(const UntypedFrontend& session);

  // Returns the steps per second, averaged over the last second, or over the last second of a
  // session that has ended.
  [[nodiscard]] double rate() const;
  // Returns the lateness during the last second.
  [[nodiscard]] LatenessHistogram lateness() const;
  [[nodiscard]] StepCounts last_second() const;
  // Returns the counts of all statuses read so far, from step `first_step` on.
  [[nodiscard]] const StepCounts& total() const noexcept { return total_; }
  [[nodiscard]] TimeIndex first_step() const noexcept { return first_; }
  // Returns the newest status.
  [[nodiscard]] const Status& newest() const noexcept { return newest_; }

 private:
  struct Step {
    TimeIndex time_index;
    std::int64_t time;
    Nanoseconds lateness;
    std::uint32_t flags;
    std::uint32_t skipped_ticks;
  };

  void take(TimeIndex t, const Status& status, Nanoseconds period);

  std::uint64_t session_id_{0};
  TimeIndex first_{0};
  TimeIndex next_{0};
  std::int64_t now_{0};
  std::deque<Step> recent_;  // steps of the last second
  StepCounts total_;
  Status newest_{};
};

// Returns the elements per second in a companion, averaged over the last second.
[[nodiscard]] double arrival_rate(const UntypedFrontend& companion);

}  // namespace trifinger::apps
