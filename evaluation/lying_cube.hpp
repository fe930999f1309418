// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "evaluation/skill_trial.hpp"
#include "trifinger/base/error.hpp"

// What the judges of skills that move a cube on the table share.
namespace trifinger::evaluation {

inline constexpr std::array<const char*, 6> kFaces{"+x", "-x", "+y", "-y", "+z", "-z"};

[[nodiscard]] inline std::size_t face_of(const std::string& name) {
  const auto* const found = std::ranges::find(kFaces, name);
  if (found == kFaces.end()) throw InvalidArgument("there is no face " + name);
  return static_cast<std::size_t>(found - kFaces.begin());
}

// A setting of the trial's skill.
[[nodiscard]] inline std::optional<std::string> setting(const SkillTrial& trial,
                                                        const std::string& key) {
  for (const std::string& text : trial.settings)
    if (text.starts_with(key + "=")) return text.substr(key.size() + 1);
  return std::nullopt;
}

// In words, what is wrong with how the cube stands at `step`; empty if it stands by itself.
[[nodiscard]] inline std::string_view wrong_with(const TrueStep& step) {
  if (step.touches() > 0) return "a tip touches it";
  if (step.twist.linear.norm() > 0.005 || step.twist.angular.norm() > 0.1) return "it moves";
  return "";
}

// Returns what is wrong at the first step of the last second at which `wrong` says something.
[[nodiscard]] inline std::string last_second(
    const SkillTrialResult& result, const std::function<std::string(const TrueStep&)>& wrong) {
  constexpr std::size_t kSteps = 1000;
  const std::size_t first = result.truth.size() > kSteps ? result.truth.size() - kSteps : 0;
  for (std::size_t i = first; i < result.truth.size(); ++i) {
    const std::string words = wrong(result.truth[i]);
    if (!words.empty()) return words;
  }
  return "";
}

[[nodiscard]] inline double duration_of(const SkillTrialResult& result) {
  return 1e-3 * static_cast<double>(result.end);
}

}  // namespace trifinger::evaluation
