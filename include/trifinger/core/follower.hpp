// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// Sees every session of a back-end in the same process. A recorder is one.
///
/// In real-time mode a follower is a reader like any other. Outside real-time mode the back-end
/// waits for its followers and overwrites nothing that they still have to read; see
/// `BackendOptions`.
///
/// A follower that was given up and has lost steps should not continue at the oldest step of the
/// history, but well inside it. The oldest step may be overwritten before the follower reports its
/// place.
class Follower {
 public:
  Follower() = default;
  Follower(const Follower&) = delete;
  Follower& operator=(const Follower&) = delete;
  virtual ~Follower() = default;

  /// The back-end calls this when a session is about to begin. `companions` are those of its robot.
  /// The call comes from the thread of the back-end, between sessions: the robot is at rest and
  /// users wait. The series stay readable as long as the follower keeps the `Session`s.
  virtual void begin_session(const Session& robot,
                             const std::vector<Session>& companions) noexcept = 0;
  /// Returns the first step of the current session that the follower still has to read. It is 0
  /// after `begin_session` and only grows. The back-end may overwrite earlier steps, and what
  /// companions received at them. The call comes from the thread of the back-end, at any time.
  [[nodiscard]] virtual TimeIndex next_step() const noexcept TRIFINGER_REALTIME = 0;
};

}  // namespace trifinger
