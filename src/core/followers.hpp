// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <vector>

#include "session_place.hpp"
#include "session_writer.hpp"
#include "trifinger/core/follower.hpp"

namespace trifinger::detail {

// The followers for which a back-end waits, so that they lose nothing. Only the back-end's thread
// uses this.
class Followers {
 public:
  explicit Followers(Timeout max_wait) : max_wait_(max_wait) {}

  // Adds a follower from the next session on.
  void add(Follower& follower) { followers_.push_back({.follower = &follower}); }
  void begin_session(const SessionHost& host, const SessionPlace::Writers& writers);

  // True if step `t` overwrites nothing that a follower still has to read. It costs two comparisons
  // while nobody lags a whole history, and one more for each companion.
  [[nodiscard]] bool have_room_for(TimeIndex t) noexcept {
    if (t >= next_look_) return look(t);
    for (const FollowedCompanion& companion : companions_) {
      if (!companion.has_room()) return look(t);
    }
    return true;
  }
  // Waits a moment for room for step `t`. Gives up followers that have not moved for too long.
  void wait(TimeIndex t) noexcept;

 private:
  struct Entry {
    Follower* follower;
    bool has_joined{false};
    bool is_given_up{false};
    // For a follower that the back-end waits for:
    TimeIndex seen_step{-1};
    Nanoseconds waited{0};  // time since the follower moved
  };
  struct FollowedCompanion {
    const SessionWriter* writer;
    TimeIndex capacity;
    TimeIndex first_unread{0};  // first element not read by some follower, as far as we know

    // The driver decides how many elements a step adds. Half of the history is kept free for them.
    [[nodiscard]] bool has_room() const noexcept { return has_room_from(first_unread); }
    [[nodiscard]] bool has_room_from(TimeIndex unread) const noexcept {
      return writer->end_of(Series::kObservation) - unread <= capacity / 2;
    }
    [[nodiscard]] TimeIndex first_element_at(TimeIndex step) const noexcept;
  };

  // Asks all followers. True if there is room for step `t` and `margin` steps after it.
  bool look(TimeIndex t, TimeIndex margin = 0) noexcept;
  // True if a follower that is at `next_step` would lose something in step `t`.
  [[nodiscard]] bool blocks(TimeIndex next_step, TimeIndex t) const noexcept;

  Timeout max_wait_;
  std::vector<Entry> followers_;
  TimeIndex capacity_{0};
  std::vector<FollowedCompanion> companions_;
  TimeIndex next_look_{std::numeric_limits<TimeIndex>::max()};  // first step to ask them again
};

}  // namespace trifinger::detail
