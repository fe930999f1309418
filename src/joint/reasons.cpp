// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/reasons.hpp"

#include <algorithm>
#include <array>
#include <tuple>

namespace trifinger {
namespace {

struct ReasonRow {
  Reason reason;
  std::string_view name;
  std::string_view sentence;
};

// Every reason, in the order of their bits.
constexpr std::array kReasonRows = std::to_array<ReasonRow>({
    {Reason::kTorqueNotFinite, "torque_not_finite",
     "the torque asked for is NaN or infinite; the joint holds its last accepted target"},
    {Reason::kPositionNotFinite, "position_not_finite",
     "the position asked for is infinite; the joint holds its last accepted target"},
    {Reason::kKpOutOfBounds, "kp_out_of_bounds",
     "position_kp is not between 0 and max_kp; the joint holds its last accepted target"},
    {Reason::kKdOutOfBounds, "kd_out_of_bounds",
     "position_kd is not between 0 and max_kd; the joint holds its last accepted target"},
    {Reason::kOwnCheck, "own_check",
     "a check that was added for this robot or task changed the action"},
    {Reason::kTargetClamped, "target_clamped",
     "the position asked for was beyond a soft limit and was moved to it"},
    {Reason::kPushedBack, "pushed_back", "the joint is beyond a soft limit and is pushed back"},
    {Reason::kTorqueClipped, "torque_clipped", "the torque was clipped to the joint's maximum"},
    {Reason::kDamped, "damped", "the safety damping acts against the joint's velocity"},
    {Reason::kHardLimit, "hard_limit", "the joint is beyond its hard limit"},
    {Reason::kBadMeasurement, "bad_measurement",
     "the measured position, velocity or torque is no plausible number"},
    {Reason::kOwnCheckFailed, "own_check_failed",
     "a check that was added for this robot or task threw an exception"},
    {Reason::kBraking, "braking", "the robot brakes because of a fault"},
    {Reason::kTorqueRateLimited, "torque_rate_limited",
     "the torque asked for changed faster than max_torque_rate and follows with delay"},
    {Reason::kDerated, "derated",
     "the motor is warm and the torque was clipped to what it can carry"},
    {Reason::kTooFast, "too_fast",
     "the joint is faster than max_velocity, or than it may be so near to a soft limit, and is "
     "braked"},
    {Reason::kOverheated, "overheated",
     "the motor is too warm: it has given more torque than was commanded"},
    {Reason::kPositionJumped, "position_jumped",
     "the measured position changed faster than a joint can move"},
    {Reason::kVelocityMismatch, "velocity_mismatch",
     "the measured velocity is not that of the measured position"},
    {Reason::kStuck, "stuck", "the measurements do not change at all, whatever the torque"},
});

constexpr std::array kAllReasons =
    std::apply([](const auto&... rows) { return std::array{rows.reason...}; }, kReasonRows);

constexpr ReasonRow reason_row(Reason reason) noexcept {
  const auto* const row = std::ranges::find(kReasonRows, reason, &ReasonRow::reason);
  return row != kReasonRows.end() ? *row : ReasonRow{reason, "unknown", "unknown reason"};
}

}  // namespace

std::span<const Reason> all_reasons() noexcept { return kAllReasons; }

std::string_view name_of(Reason reason) noexcept { return reason_row(reason).name; }

std::string names_of(std::uint64_t reasons) {
  std::string names;
  for (const ReasonRow& row : kReasonRows) {
    if (!has(reasons, row.reason)) continue;
    if (!names.empty()) names += ", ";
    names += row.name;
  }
  return names;
}

std::string_view describe(Reason reason) noexcept { return reason_row(reason).sentence; }

}  // namespace trifinger
