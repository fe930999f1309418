// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "shared/terminal.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {

// The state of a session, including states that its phase alone does not show.
enum class Health : unsigned char {
  kGood,     // The session is in one of its phases.
  kFault,    // The session ended with a fault that waits for `recover`.
  kSilent,   // The back-end lives but has given no sign for a while: stopped, or in a debugger.
  kStopped,  // The back-end has come to an orderly end.
  kDead,     // The back-end was killed or has crashed.
};
[[nodiscard]] Health health_of(const SessionInfo& info) noexcept;
[[nodiscard]] Style style_of(Health health) noexcept;
// Returns the phase, or the health if that is not good, in one word: "running", "dead".
[[nodiscard]] std::string state_text(const SessionInfo& info);
// Returns who controls the robot: "python3 (process 4711)" or "nobody".
[[nodiscard]] std::string controller_text(const SessionInfo& info);

// True if the number of the process means this process here, too: not that of another container.
[[nodiscard]] bool is_seen(const ipc::ProcessIdentity& process) noexcept;

// Returns the robot of a session: "sim" for "sim.object".
[[nodiscard]] std::string robot_of(const std::string& session);
// Returns what is known about the robot `name`. Refuses companions, because they start and end with
// their robot. Throws SessionNotFound, UsageError.
[[nodiscard]] SessionInfo robot_info(const std::string& name);

}  // namespace trifinger::apps
