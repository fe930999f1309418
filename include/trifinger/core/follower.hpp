// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger {

/// Someone in the process of a back-end who sees every session: a recorder.
///
/// In real-time mode a follower is a reader like any other. Outside it the back-end waits for its
/// followers rather than overwrite what they have not read.
class Follower {
 public:
  virtual ~Follower() = default;

  /// A session is about to begin; `companions` are those of its robot. Called by the thread of the
  /// back-end, between sessions. The series stay readable as long as the `Session`s are kept.
  virtual void begin_session(const Session& robot, const std::vector<Session>& companions) = 0;
  /// The first step of the session in work that it still has to read. Called by the thread of the
  /// back-end, in every step.
  [[nodiscard]] virtual TimeIndex next_step() const noexcept = 0;
};

}  // namespace trifinger
