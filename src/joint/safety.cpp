// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/safety.hpp"

#include <string>

namespace trifinger {
namespace {

// More joints than any robot here has; a joint beyond gets the text without a number.
constexpr std::size_t kNamedJoints = 32;

using JointTexts = std::array<std::string, kNamedJoints>;

JointTexts texts_for_joints(const std::string& what) {
  JointTexts texts;
  for (std::size_t i = 0; i < texts.size(); ++i)
    texts[i] = "joint " + std::to_string(i) + " " + what;
  return texts;
}

// What is wrong with one joint, to stand behind "joint 4 "; empty for what is not about one joint.
std::string_view predicate_of(SafetyFault fault) noexcept {
  switch (fault) {
    case SafetyFault::kNone:
    case SafetyFault::kOwnCheck:
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

constexpr auto kLastFault = static_cast<std::size_t>(SafetyFault::kOverheated);

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
  }
  return "unknown fault";
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
  // A joint of -1, which is none, wraps around to more than there are.
  const auto joint = static_cast<std::size_t>((fault_code >> 8) - 1);
  if (joint >= kNamedJoints || predicate_of(fault).empty()) return describe(fault);
  return texts[low_bits][joint];
}

}  // namespace trifinger
