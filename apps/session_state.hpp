// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "terminal.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::apps {

// How a session is doing, with what its phase alone does not say.
enum class Health : unsigned char {
  kGood,     // In one of its phases.
  kFault,    // Ended with a fault that waits for `recover`.
  kSilent,   // The back-end lives but has given no sign for a while: stopped, or in a debugger.
  kStopped,  // The back-end has come to an orderly end.
  kDead,     // The back-end was killed or has crashed.
};
[[nodiscard]] Health health_of(const SessionInfo& info) noexcept;
[[nodiscard]] Style style_of(Health health) noexcept;
// The phase, or the health if that is not good, in one word: "running", "dead".
[[nodiscard]] std::string state_text(const SessionInfo& info);
// Who controls: "python3 (process 4711)" or "nobody".
[[nodiscard]] std::string controller_text(const SessionInfo& info);

// The robot of a session: "sim" of "sim.object".
[[nodiscard]] std::string robot_of(const std::string& session);
// What is known about the robot `name`; refuses companions, which live and die with their robot.
// Throws SessionNotFound, UsageError.
[[nodiscard]] SessionInfo robot_info(const std::string& name);

}  // namespace trifinger::apps
