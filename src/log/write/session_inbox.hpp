// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::log::detail {

// A session that the back-end of this process has handed over.
struct HandedSession {
  Session robot;
  std::vector<Session> companions;
  std::shared_ptr<std::atomic<TimeIndex>> next_step;
};

// Sessions on their way from the back-end of this process to its recorder.
class SessionInbox {
 public:
  // Sessions that have ended stay in memory while they wait for the disk, at most this many.
  static constexpr std::size_t kMaxWaiting = 16;

  // ---- called by the back-end's thread ----

  // Hands over a session. Outside real-time mode, waits a second at most for room, so that nothing
  // is lost; after that the session is dropped. Waits as long for the payloads of the session
  // before, which are overwritten now.
  void put(const Session& robot, const std::vector<Session>& companions);
  // Returns the first step of the newest session that is still to be read.
  [[nodiscard]] TimeIndex next_step() const noexcept;

  // ---- called by the recorder's thread ----

  struct Taken {
    std::vector<HandedSession> sessions;
    std::size_t dropped;  // number of sessions dropped since the last call
  };
  [[nodiscard]] Taken take(std::size_t max_sessions);
  [[nodiscard]] bool is_empty() const;
  // Gives up all sessions, those that come later included.
  void close() noexcept;

 private:
  void wait_for_payloads();

  mutable std::mutex mutex_;
  std::condition_variable has_room_;
  std::deque<HandedSession> waiting_;
  std::size_t dropped_{0};
  bool is_closed_{false};

  // Used by the back-end's thread only:
  std::shared_ptr<std::atomic<TimeIndex>> newest_;
  std::optional<UntypedFrontend> with_payloads_;  // the newest session, if it has payloads
};

}  // namespace trifinger::log::detail
