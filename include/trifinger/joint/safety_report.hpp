// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "trifinger/base/text.hpp"
#include "trifinger/joint/limits.hpp"
#include "trifinger/joint/safety_checks.hpp"
#include "trifinger/realtime/annotations.hpp"

/// \file
/// What the safety chain tells the driver: faults, their codes and texts, and rejected commands.

namespace trifinger {

/// Why the checks want the robot to stop. The values are stable, because drivers use them as fault
/// codes.
enum class SafetyFault : std::int32_t {
  kNone = 0,
  kHardLimit = 1,         ///< A joint is beyond its hard limit.
  kBadMeasurement = 2,    ///< A measured number is not finite or beyond `kPlausible`.
  kOwnCheck = 3,          ///< An added check has thrown an exception.
  kPositionJumped = 4,    ///< A position changed faster than `max_position_rate`.
  kVelocityMismatch = 5,  ///< Velocity and change of position differ by `max_velocity_error`.
  kStuck = 6,             ///< Nothing moved for too long while the torque varied.
  kOverheated = 7,        ///< A motor is warmer than an obedient motor can be.
  kInterrupted = 8,       ///< No fault: an added check has thrown `Interrupted`.
};

/// A sentence without the joint, for example "a joint is beyond its hard limit".
[[nodiscard]] std::string_view describe(SafetyFault fault) noexcept;

/// The most significant fault in the reasons of one joint; `kNone` without any. Implausible
/// measurements come first: if they cannot be true, the joint may not be where it seems to be.
[[nodiscard]] SafetyFault fault_of(std::uint64_t reasons) noexcept TRIFINGER_REALTIME;

/// The findings of the checks in one step. The reasons of the applied action tell which joint and
/// which field are concerned.
struct SafetyReport {
  SafetyFault fault{SafetyFault::kNone};
  std::int32_t joint{-1};       ///< The first joint at fault; -1 if no single joint is.
  bool action_rejected{false};  ///< The action was rejected at some joint.
};

/// The fault code that a driver reports: the fault in the lowest 8 bits, and above them the joint
/// counted from 1. A driver's own codes must have 64 or more in the lowest 8 bits.
[[nodiscard]] constexpr std::int32_t fault_code_of(const SafetyReport& report) noexcept {
  return static_cast<std::int32_t>(report.fault) + ((report.joint + 1) << 8);
}
/// The text of such a code, for example "joint 4 is beyond its hard limit"; empty if `fault_code`
/// is not from `fault_code_of`. The text is valid for ever. Do not call this first in the loop: the
/// first call makes the texts.
[[nodiscard]] std::string_view fault_text_of(std::int32_t fault_code) noexcept;

/// The same text for a robot whose joints have names: "joint 4 (elbow) is beyond its hard limit".
/// `joint_name` may be empty. Needs no memory from the heap.
[[nodiscard]] FixedText describe(const SafetyReport& report, std::string_view joint_name) noexcept;

/// Describes a rejected action: the first joint whose command was rejected.
struct RejectedCommand {
  std::size_t joint{0};
  std::uint64_t reasons{0};   ///< The bits of `kRejected` in the joint's reasons.
  JointCommand command;       ///< The command that was desired.
  bool is_own_check{false};   ///< The desired command was acceptable, but a check made it invalid.
  std::size_t num_values{0};  ///< Number of rejected values in the whole action.
};

/// Describes a rejection, for example "position_kd of joint 1 (finger_upper_to_middle_joint_0) is
/// 1, allowed are 0 to 0.5 (max_kd)". `joint_name` may be empty. Needs no memory from the heap.
[[nodiscard]] FixedText describe(const RejectedCommand& rejected, std::string_view joint_name,
                                 const JointLimit& limit) noexcept;

}  // namespace trifinger
