// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>

#include "trifinger/base/time.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/timing.hpp"

namespace trifinger::apps {

// What the statuses of one session say about its loop. Waits for nothing and disturbs nobody.
class LoopFigures {
 public:
  struct Counts {
    std::int64_t steps{0};
    std::int64_t repeats{0};
    std::int64_t rejected{0};
    std::int64_t acausal{0};
    std::int64_t skipped{0};  // ticks
  };

  // Takes in the statuses that have come since the last call; at the first call, all that the
  // history keeps. `session` may be another one than before: then the figures begin anew.
  // @throws IncompatibleSession if its statuses are those of another version
  void update(const UntypedFrontend& session);

  // Steps per second, over the last second. At the end of a session, over its last second.
  [[nodiscard]] double rate() const;
  // Over the last second.
  [[nodiscard]] LatenessHistogram lateness() const;
  [[nodiscard]] Counts last_second() const;
  // Over all statuses taken in, from step `first_step` on.
  [[nodiscard]] const Counts& total() const noexcept { return total_; }
  [[nodiscard]] TimeIndex first_step() const noexcept { return first_; }
  // The newest status.
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
  static void count(const Step& step, Counts& counts) noexcept;

  std::uint64_t session_id_{0};
  TimeIndex first_{0};
  TimeIndex next_{0};
  std::int64_t now_{0};
  std::deque<Step> recent_;  // of the last second
  Counts total_;
  Status newest_{};
};

// Elements per second in a companion, over the last second.
[[nodiscard]] double arrival_rate(const UntypedFrontend& companion);

}  // namespace trifinger::apps
