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

}  // namespace

std::string_view describe(SafetyFault fault) noexcept {
  switch (fault) {
    case SafetyFault::kNone:
      return "no fault";
    case SafetyFault::kHardLimit:
      return "a joint is beyond its hard limit";
    case SafetyFault::kBadMeasurement:
      return "a measured position or velocity is no plausible number";
    case SafetyFault::kOwnCheck:
      return "a check that was added for this robot or task threw an exception";
  }
  return "unknown fault";
}

std::string_view fault_text_of(std::int32_t fault_code) noexcept {
  static const JointTexts hard_limit = texts_for_joints("is beyond its hard limit");
  static const JointTexts bad_measurement =
      texts_for_joints("has measured a position or velocity that is no plausible number");
  const std::int32_t low_bits = fault_code & 0xFF;
  if (low_bits <= 0 || low_bits > static_cast<std::int32_t>(SafetyFault::kOwnCheck)) return {};
  const auto fault = static_cast<SafetyFault>(low_bits);
  // A joint of -1, which is none, wraps around to more than there are.
  const auto joint = static_cast<std::size_t>((fault_code >> 8) - 1);
  if (joint < kNamedJoints) {
    if (fault == SafetyFault::kHardLimit) return hard_limit[joint];
    if (fault == SafetyFault::kBadMeasurement) return bad_measurement[joint];
  }
  return describe(fault);
}

}  // namespace trifinger
