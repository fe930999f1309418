// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/document.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::log {

/// What a log says about a session at its beginning; see docs/log_format.md.
struct SessionHeader {
  std::string name;
  std::uint64_t session_id{0};
  bool is_real_time{false};
  /// In real-time mode: what kept the loop from being a real-time thread, one sentence each.
  /// Nothing if it was not recorded.
  std::optional<std::vector<std::string>> realtime_warnings{};
  Nanoseconds period{0};
  std::int64_t created{0};  ///< Time since 1970 [ns].
  /// Add this to times of the session to get times since 1970 [ns]. In real-time mode it is the
  /// wall clock minus the monotonic clock. Otherwise it is the time of step 0, and step t is t
  /// periods later.
  std::int64_t time_offset{0};
  std::string host;
  std::int64_t backend_pid{0};
  RobotTypes types;
  struct Companion {
    std::string name;  ///< For example "sim.object".
    std::string type;
    ElementDescription element;
    TimeIndex first_index{0};  ///< Index of the first element in this file.
  };
  std::vector<Companion> companions;
  std::vector<Document> documents;
  TimeIndex first_index{0};  ///< Index of the first step in this file.

  /// Makes the header from what a session says about itself.
  [[nodiscard]] static SessionHeader of(const Session& robot,
                                        const std::vector<Session>& companions);
};

}  // namespace trifinger::log
