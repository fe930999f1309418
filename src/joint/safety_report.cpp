// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/safety_report.hpp"

#include <algorithm>
#include <array>
#include <string>

namespace trifinger {
namespace {

// More joints than any robot here has. Faults of joints beyond it get a text without a number.
constexpr std::size_t kNamedJoints = 32;

using JointTexts = std::array<std::string, kNamedJoints>;

JointTexts texts_for_joints(const std::string& what) {
  JointTexts texts;
  for (std::size_t i = 0; i < texts.size(); ++i)
    texts[i] = "joint " + std::to_string(i) + " " + what;
  return texts;
}

struct FaultRow {
  SafetyFault fault;
  std::uint64_t reason;  // In the reasons of a joint, means this fault; 0 for none.
  std::string_view sentence;
  std::string_view predicate;  // Completes "joint 4 ..."; empty if the fault is of no single joint.
};

// Every fault. Those that have a reason stand in the order in which `fault_of` looks for them.
constexpr std::array kFaultRows = std::to_array<FaultRow>({
    {SafetyFault::kNone, 0, "no fault", ""},
    {SafetyFault::kBadMeasurement, bit(Reason::kBadMeasurement),
     "a measured position, velocity or torque is no plausible number",
     "has measured a position, velocity or torque that is no plausible number"},
    {SafetyFault::kPositionJumped, bit(Reason::kPositionJumped),
     "a measured position changed faster than a joint can move",
     "has measured a position that changed faster than it can move"},
    {SafetyFault::kVelocityMismatch, bit(Reason::kVelocityMismatch),
     "a measured velocity is not that of the measured position",
     "has measured a velocity that is not that of its position"},
    {SafetyFault::kStuck, bit(Reason::kStuck),
     "a joint measures the same for too long while its torque changes",
     "has measured the same for too long while its torque changed"},
    {SafetyFault::kOverheated, bit(Reason::kOverheated),
     "a motor is too warm: it has given more torque than was commanded",
     "is too warm: it has given more torque than was commanded"},
    {SafetyFault::kHardLimit, bit(Reason::kHardLimit), "a joint is beyond its hard limit",
     "is beyond its hard limit"},
    {SafetyFault::kOwnCheck, 0, "a check that was added for this robot or task threw an exception",
     ""},
    {SafetyFault::kInterrupted, 0, "the user interrupted a safety check that was added", ""},
});

}  // namespace

SafetyFault fault_of(std::uint64_t reasons) noexcept {
  for (const FaultRow& row : kFaultRows) {
    if ((reasons & row.reason) != 0) return row.fault;
  }
  return SafetyFault::kNone;
}

std::string_view describe(SafetyFault fault) noexcept {
  const auto* const row = std::ranges::find(kFaultRows, fault, &FaultRow::fault);
  return row != kFaultRows.end() ? row->sentence : "unknown fault";
}

FixedText describe(const SafetyReport& report, std::string_view joint_name) noexcept {
  const auto* const row = std::ranges::find(kFaultRows, report.fault, &FaultRow::fault);
  if (row == kFaultRows.end()) return FixedText("unknown fault");
  if (report.joint < 0 || row->predicate.empty()) return FixedText(row->sentence);
  FixedText text("joint ");
  text.append(static_cast<std::size_t>(report.joint));
  if (!joint_name.empty()) text.append(" (").append(joint_name).append(")");
  return text.append(" ").append(row->predicate);
}

FixedText describe(const RejectedCommand& rejected, std::string_view joint_name,
                   const JointLimit& limit) noexcept {
  // Describes the first field that was rejected, in the order of the fields.
  const bool is_torque = has(rejected.reasons, Reason::kTorqueNotFinite);
  const bool is_position = !is_torque && has(rejected.reasons, Reason::kPositionNotFinite);
  const bool is_kp = !is_torque && !is_position && has(rejected.reasons, Reason::kKpOutOfBounds);
  const JointCommand& command = rejected.command;

  FixedText text;
  const auto write = [&](std::string_view field, double value) {
    text.append(field).append(" of joint ").append(rejected.joint);
    if (!joint_name.empty()) text.append(" (").append(joint_name).append(")");
    if (rejected.is_own_check) {
      text.append(" was made invalid by a safety check that was added");
    } else {
      text.append(" is ").append(value);
    }
    text.append(", allowed are ");
  };
  if (is_torque) {
    write("torque", command.torque);
    text.append("finite numbers");
  } else if (is_position) {
    write("position", command.position);
    text.append("finite numbers, and NaN for no target");
  } else if (is_kp) {
    write("position_kp", command.position_kp);
    text.append("0 to ").append(limit.max_kp).append(" (max_kp)");
  } else {
    write("position_kd", command.position_kd);
    text.append("0 to ").append(limit.max_kd).append(" (max_kd)");
  }
  if (rejected.num_values > 1) {
    text.append("; of the same action ")
        .append(rejected.num_values - 1)
        .append(rejected.num_values == 2 ? " more value was" : " more values were")
        .append(" not fit");
  }
  return text;
}

std::string_view fault_text_of(std::int32_t fault_code) noexcept {
  static const auto texts = [] {
    std::array<JointTexts, kFaultRows.size()> all;
    std::ranges::transform(kFaultRows, all.begin(), [](const FaultRow& row) {
      return texts_for_joints(std::string(row.predicate));
    });
    return all;
  }();
  const auto fault = static_cast<SafetyFault>(fault_code & 0xFF);
  const auto* const row = std::ranges::find(kFaultRows, fault, &FaultRow::fault);
  if (row == kFaultRows.end() || fault == SafetyFault::kNone) return {};
  // A code without a joint gives -1, which wraps around to a number that is out of range.
  const auto joint = static_cast<std::size_t>((fault_code >> 8) - 1);
  if (joint >= kNamedJoints || row->predicate.empty()) return row->sentence;
  return texts[static_cast<std::size_t>(row - kFaultRows.begin())][joint];
}

}  // namespace trifinger
