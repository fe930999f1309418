// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "evaluation/skill_trial.hpp"

namespace trifinger::evaluation {

// What speaks against that the object rests by itself in the whole time after the skill's end, in
// words: a tip touches it, or it moves by more than a millimetre. Empty if nothing does.
[[nodiscard]] inline std::string_view what_moves(const SkillTrial& trial,
                                                 const SkillTrialResult& result) {
  constexpr double kFarthest = 1e-3;  // [m]
  if (trial.after.count() <= 0 || result.end >= result.truth.size()) return "nobody looked";
  const control::Pose& last = result.truth.back().object;
  for (std::size_t i = result.end; i < result.truth.size(); ++i) {
    const TrueStep& now = result.truth[i];
    if (now.touches() > 0) return "a tip touches it at the end";
    if ((now.object.position - last.position).norm() > kFarthest ||
        now.object.orientation.angularDistance(last.orientation) > 0.01)
      return "it moves after the end";
  }
  return {};
}

}  // namespace trifinger::evaluation
