// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger {

/// Someone in the process of a back-end who sees every session: a recorder.
///
/// In real-time mode a follower is a reader like any other. Outside it the back-end waits for its
/// followers rather than overwrite what they have not read, see `BackendOptions`.
///
/// A follower that was given up and has lost steps should go on well inside of the history, not at
/// its oldest step: that may be gone before it says where it is.
class Follower {
 public:
  Follower() = default;
  Follower(const Follower&) = delete;
  Follower& operator=(const Follower&) = delete;
  virtual ~Follower() = default;

  /// A session is about to begin; `companions` are those of its robot. Called by the thread of the
  /// back-end, between sessions: the robot is at rest and users wait. The series stay readable as
  /// long as the `Session`s are kept.
  virtual void begin_session(const Session& robot,
                             const std::vector<Session>& companions) noexcept = 0;
  /// The first step of the session in work that it still has to read: 0 from `begin_session` on,
  /// growing. Steps before it, and what companions received at them, may be overwritten. Called by
  /// the thread of the back-end, at any time.
  [[nodiscard]] virtual TimeIndex next_step() const noexcept TRIFINGER_REALTIME = 0;
};

}  // namespace trifinger
