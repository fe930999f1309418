// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace trifinger {

/// Why a joint did not get the action that was asked for. These are bits of `reasons`
/// in an applied action.
enum class Reason : std::uint64_t {
  // The action was rejected: the joint holds its last accepted target.
  kTorqueNotFinite = 1U << 0U,    ///< `torque` is NaN or infinite.
  kPositionNotFinite = 1U << 1U,  ///< `position` is infinite.
  kKpOutOfBounds = 1U << 2U,      ///< `position_kp` is negative, infinite or above its bound.
  kKdOutOfBounds = 1U << 3U,      ///< `position_kd` is negative, infinite or above its bound.

  // The action was accepted, but changed.
  kOwnCheck = 1U << 4U,       ///< A check that was added for this robot or task changed the action.
  kTargetClamped = 1U << 5U,  ///< `position` was beyond a soft limit.
  kPushedBack = 1U << 6U,     ///< The joint is beyond a soft limit: pushed back, no outward torque.
  kTorqueClipped = 1U << 7U,  ///< Torque and PD together exceeded the joint's maximum.
  kDamped = 1U << 8U,         ///< The safety damping changed the torque.

  // Faults: the whole robot brakes.
  kHardLimit = 1U << 9U,        ///< The joint is beyond its hard limit.
  kBadMeasurement = 1U << 10U,  ///< A measured number is not plausible.
  kOwnCheckFailed = 1U << 11U,  ///< An added check has thrown an exception.
  kBraking = 1U << 12U,         ///< The robot brakes because of a fault.

  // These were added later; bits keep their meaning. The action was accepted, but changed.
  kTorqueRateLimited = 1U << 13U,  ///< The requested torque changed faster than allowed.
  kDerated = 1U << 14U,            ///< The motor is warm: torque is clipped below the maximum.
  kTooFast = 1U << 15U,            ///< The joint is too fast: generally, or so near a soft limit.
  // These are faults.
  kOverheated = 1U << 16U,        ///< The motor is too warm, so it does not obey its commands.
  kPositionJumped = 1U << 17U,    ///< The position changed faster than a joint can move.
  kVelocityMismatch = 1U << 18U,  ///< Velocity and change of position have differed for too long.
  kStuck = 1U << 19U,             ///< Nothing moves although the torque changes.
};

/// All reasons, in the order of their bits.
[[nodiscard]] std::span<const Reason> all_reasons() noexcept;

/// The reasons for rejecting an action.
inline constexpr std::uint64_t kRejected = 0xFU;

[[nodiscard]] constexpr std::uint64_t bit(Reason reason) noexcept {
  return static_cast<std::uint64_t>(reason);
}
/// The reasons that mean that a measurement of this joint cannot be true.
inline constexpr std::uint64_t kImplausible = bit(Reason::kBadMeasurement) |
                                              bit(Reason::kPositionJumped) |
                                              bit(Reason::kVelocityMismatch) | bit(Reason::kStuck);

[[nodiscard]] constexpr bool has(std::uint64_t reasons, Reason reason) noexcept {
  return (reasons & bit(reason)) != 0;
}

/// Name of the reason, such as "torque_clipped", as Python, logs and plots show it.
[[nodiscard]] std::string_view name_of(Reason reason) noexcept;
/// Names of all reasons, such as "torque_clipped, damped"; empty for none.
[[nodiscard]] std::string names_of(std::uint64_t reasons);
/// A sentence for people, for example "the torque was clipped to the joint's maximum".
[[nodiscard]] std::string_view describe(Reason reason) noexcept;

}  // namespace trifinger
