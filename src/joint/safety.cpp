// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/safety.hpp"

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

// Says what is wrong with a joint: the text after "joint 4 ". Empty for faults that are not about
// one joint.
std::string_view predicate_of(SafetyFault fault) noexcept {
  switch (fault) {
    case SafetyFault::kNone:
    case SafetyFault::kOwnCheck:
    case SafetyFault::kInterrupted:
      return {};
    case SafetyFault::kHardLimit:
      return "is beyond its hard limit";
    case SafetyFault::kBadMeasurement:
      return "has measured a position, velocity or torque that is no plausible number";
    case SafetyFault::kPositionJumped:
      return "has measured a position that changed faster than it can move";
    case SafetyFault::kVelocityMismatch:
      return "has measured a velocity that is not that of its position";
    case SafetyFault::kStuck:
      return "has measured the same for too long while its torque changed";
    case SafetyFault::kOverheated:
      return "is too warm: it has given more torque than it was told";
  }
  return {};
}

constexpr auto kLastFault = static_cast<std::size_t>(SafetyFault::kInterrupted);

}  // namespace

std::string_view describe(SafetyFault fault) noexcept {
  switch (fault) {
    case SafetyFault::kNone:
      return "no fault";
    case SafetyFault::kHardLimit:
      return "a joint is beyond its hard limit";
    case SafetyFault::kBadMeasurement:
      return "a measured position, velocity or torque is no plausible number";
    case SafetyFault::kOwnCheck:
      return "a check that was added for this robot or task threw an exception";
    case SafetyFault::kPositionJumped:
      return "a measured position changed faster than a joint can move";
    case SafetyFault::kVelocityMismatch:
      return "a measured velocity is not that of the measured position";
    case SafetyFault::kStuck:
      return "a joint measures the same for too long while its torque changes";
    case SafetyFault::kOverheated:
      return "a motor is too warm: it has given more torque than it was told";
    case SafetyFault::kInterrupted:
      return "the user interrupted a safety check that was added";
  }
  return "unknown fault";
}

FixedText describe(const RejectedCommand& rejected, std::string_view joint_name,
                   const JointLimit& limit) noexcept {
  // Describes the first field that was rejected, in the order of the fields.
  const bool is_torque = has(rejected.reasons, Reason::kTorqueNotFinite);
  const bool is_position = !is_torque && has(rejected.reasons, Reason::kPositionNotFinite);
  const bool is_kp = !is_torque && !is_position && has(rejected.reasons, Reason::kKpOutOfBounds);
  const JointCommand& command = rejected.command;

  FixedText text;
  const auto write = [&](std::string_view field, double value, std::string_view unit) {
    text.append(field).append(" of joint ").append(rejected.joint);
    if (!joint_name.empty()) text.append(" (").append(joint_name).append(")");
    if (rejected.is_own_check) {
      text.append(" was made invalid by a safety check that was added");
    } else {
      text.append(" is ").append(value).append(" ").append(unit);
    }
    text.append(", allowed are ");
  };
  if (is_torque) {
    write("torque", command.torque, "Nm");
    text.append("finite numbers");
  } else if (is_position) {
    write("position", command.position, "rad");
    text.append("finite numbers, and NaN for no target");
  } else if (is_kp) {
    write("position_kp", command.position_kp, "Nm/rad");
    text.append("0 to ").append(limit.max_kp).append(" (safety.max_kp)");
  } else {
    write("position_kd", command.position_kd, "Nms/rad");
    text.append("0 to ").append(limit.max_kd).append(" (safety.max_kd)");
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
    std::array<JointTexts, kLastFault + 1> all;
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i] = texts_for_joints(std::string(predicate_of(static_cast<SafetyFault>(i))));
    }
    return all;
  }();
  const auto low_bits = static_cast<std::size_t>(fault_code & 0xFF);
  if (low_bits == 0 || low_bits > kLastFault) return {};
  const auto fault = static_cast<SafetyFault>(low_bits);
  // A code without a joint gives -1, which wraps around to a number that is out of range.
  const auto joint = static_cast<std::size_t>((fault_code >> 8) - 1);
  if (joint >= kNamedJoints || predicate_of(fault).empty()) return describe(fault);
  return texts[low_bits][joint];
}

}  // namespace trifinger
