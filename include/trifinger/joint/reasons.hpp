// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace trifinger {

/// Why a joint was not given what was asked of it; bits of `AppliedJointAction::reasons`.
enum class Reason : std::uint64_t {
  // The action was not fit to apply: the joint holds its last accepted target.
  kTorqueNotFinite = 1U << 0U,    ///< `torque` is NaN or infinite.
  kPositionNotFinite = 1U << 1U,  ///< `position` is infinite.
  kKpOutOfBounds = 1U << 2U,      ///< `position_kp` is negative, infinite or above its bound.
  kKdOutOfBounds = 1U << 3U,      ///< `position_kd`, likewise.

  // The action was fit, but changed.
  kOwnCheck = 1U << 4U,       ///< A check that was added for this robot or task changed the action.
  kTargetClamped = 1U << 5U,  ///< `position` was beyond a soft limit.
  kPushedBack = 1U << 6U,     ///< The joint is beyond a soft limit: pushed back, no outward torque.
  kTorqueClipped = 1U << 7U,  ///< Torque and PD together were above the joint's maximum.
  kDamped = 1U << 8U,         ///< The safety damping changed the torque.

  // Faults: the whole robot brakes.
  kHardLimit = 1U << 9U,        ///< The joint is beyond its hard limit.
  kBadMeasurement = 1U << 10U,  ///< A measured number is no plausible one.
  kOwnCheckFailed = 1U << 11U,  ///< A check that was added has thrown.
  kBraking = 1U << 12U,         ///< The robot brakes because of a fault.

  // Added later; bits keep their meaning. The action was fit, but changed.
  kTorqueRateLimited = 1U << 13U,  ///< The torque asked for changed faster than it may.
  kDerated = 1U << 14U,            ///< The motor is warm: torque is clipped below the maximum.
  kTooFast = 1U << 15U,            ///< The joint is too fast, at all or so near to a soft limit.
  // Faults.
  kOverheated = 1U << 16U,        ///< The motor is too warm: it does not obey.
  kPositionJumped = 1U << 17U,    ///< The position changed faster than it can.
  kVelocityMismatch = 1U << 18U,  ///< Velocity and change of position differ for too long.
  kStuck = 1U << 19U,             ///< Nothing moves, whatever the torque.
};

/// All reasons, in the order of their bits.
[[nodiscard]] std::span<const Reason> all_reasons() noexcept;

/// The reasons that mean "this action was not fit to apply".
inline constexpr std::uint64_t kRejected = 0xFU;

[[nodiscard]] constexpr std::uint64_t bit(Reason reason) noexcept {
  return static_cast<std::uint64_t>(reason);
}
/// The reasons that mean "what this joint measures cannot be true".
inline constexpr std::uint64_t kImplausible = bit(Reason::kBadMeasurement) |
                                              bit(Reason::kPositionJumped) |
                                              bit(Reason::kVelocityMismatch) | bit(Reason::kStuck);

[[nodiscard]] constexpr bool has(std::uint64_t reasons, Reason reason) noexcept {
  return (reasons & bit(reason)) != 0;
}

/// "torque_clipped": the name as Python, logs and plots show it.
[[nodiscard]] std::string_view name_of(Reason reason) noexcept;
/// "torque_clipped, damped"; empty for none.
[[nodiscard]] std::string names_of(std::uint64_t reasons);
/// A sentence for people, as in "the torque was clipped to the joint's maximum".
[[nodiscard]] std::string_view describe(Reason reason) noexcept;

}  // namespace trifinger
