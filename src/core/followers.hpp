// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <vector>

#include "session_memory.hpp"
#include "trifinger/core/follower.hpp"

namespace trifinger::detail {

// Those whom a back-end waits for, so that they lose nothing. Used by its thread alone.
class Followers {
 public:
  explicit Followers(Timeout max_wait) : max_wait_(max_wait) {}

  // From the next session on.
  void add(Follower& follower) { followers_.push_back({.follower = &follower}); }
  void begin_session(const SessionHost& host, const SessionPlace::Writers& writers);

  // True if step `t` overwrites nothing that a follower still has to read. Two comparisons while
  // nobody is a whole history behind, one more for each companion.
  [[nodiscard]] bool have_room_for(TimeIndex t) noexcept {
    if (t >= next_look_) return look(t);
    for (const FollowedCompanion& companion : companions_) {
      if (!companion.has_room()) return look(t);
    }
    return true;
  }
  // Waits a moment for room for step `t`, and gives those up who have not moved for too long.
  void wait(TimeIndex t) noexcept;

 private:
  struct Entry {
    Follower* follower;
    bool has_joined{false};
    bool is_given_up{false};
    // While it is waited for:
    TimeIndex seen_step{-1};
    Nanoseconds waited{0};  // since it moved
  };
  struct FollowedCompanion {
    const SessionWriter* writer;
    TimeIndex capacity;
    TimeIndex first_unread{0};  // by any follower, as far as we know

    // How many elements a step adds is the driver's business; half of the history is kept free for
    // them.
    [[nodiscard]] bool has_room() const noexcept { return has_room_behind(first_unread); }
    [[nodiscard]] bool has_room_behind(TimeIndex unread) const noexcept {
      return writer->end_of(Series::kObservation) - unread <= capacity / 2;
    }
    [[nodiscard]] TimeIndex first_element_at(TimeIndex step) const noexcept;
  };

  // Asks everybody. True if there is room for step `t` and `margin` steps behind it.
  bool look(TimeIndex t, TimeIndex margin = 0) noexcept;
  // True if a follower that is at `next_step` would lose something by step `t`.
  [[nodiscard]] bool blocks(TimeIndex next_step, TimeIndex t) const noexcept;

  Timeout max_wait_;
  std::vector<Entry> followers_;
  TimeIndex capacity_{0};
  std::vector<FollowedCompanion> companions_;
  TimeIndex next_look_{std::numeric_limits<TimeIndex>::max()};  // the first step to ask for
};

}  // namespace trifinger::detail
