// SPDX-License-Identifier: BSD-3-Clause
#include "robot/session_state.hpp"

#include <fmt/format.h>

#include "shared/exit_code.hpp"

namespace trifinger::apps {
namespace {

// A waiting back-end gives a sign of life every 50 ms.
constexpr Nanoseconds kSilence = std::chrono::seconds(2);

}  // namespace

Health health_of(const SessionInfo& info) noexcept {
  const bool has_ended = info.phase == SessionInfo::Phase::kEnded;
  if (!info.backend_is_alive) return has_ended ? Health::kStopped : Health::kDead;
  if (has_ended && info.fault.needs_recovery()) return Health::kFault;
  return info.since_heartbeat > kSilence ? Health::kSilent : Health::kGood;
}

Style style_of(Health health) noexcept {
  switch (health) {
    case Health::kGood:
      return Style::kGood;
    case Health::kStopped:
      return Style::kDim;
    case Health::kSilent:
      return Style::kWarning;
    case Health::kFault:
    case Health::kDead:
      break;
  }
  return Style::kBad;
}

std::string state_text(const SessionInfo& info) {
  switch (health_of(info)) {
    case Health::kGood:
      break;
    case Health::kFault:
      return fmt::format("fault: {}", name_of(info.fault.code));
    case Health::kSilent:
      return fmt::format("silent for {}", duration_text(info.since_heartbeat));
    case Health::kStopped:
      return info.fault.needs_recovery() ? fmt::format("gone: {}", name_of(info.fault.code))
                                         : "gone";
    case Health::kDead:
      return "dead";
  }
  return std::string(name_of(info.phase));
}

std::string controller_text(const SessionInfo& info) {
  return info.controller.pid == 0 ? "nobody" : ipc::describe(info.controller);
}

bool is_seen(const ipc::ProcessIdentity& process) noexcept {
  return process.number_space == 0 ||
         process.number_space == ipc::ProcessIdentity::of_this_process().number_space;
}

std::string robot_of(const std::string& session) { return session.substr(0, session.find('.')); }

SessionInfo robot_info(const std::string& name) {
  SessionInfo info = Session::open(name).info();
  if (info.is_companion) {
    throw UsageError(
        fmt::format("'{}' is a companion of the robot '{}': name the robot", name, robot_of(name)));
  }
  return info;
}

}  // namespace trifinger::apps
