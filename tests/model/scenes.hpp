// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "trifinger/model/robot_description.hpp"

namespace trifinger::test {

inline constexpr Variant kVariants[] = {Variant::kEdu, Variant::kPro, Variant::kOne};
inline constexpr Arrangement kArrangements[] = {Arrangement::kTriFinger,
                                                Arrangement::kSingleFinger};

/// Returns every variant, in both arrangements, upright and flipped, each with four objects.
inline std::vector<RobotDescription> all_robots() {
  std::vector<RobotDescription> robots;
  for (const Variant variant : kVariants)
    for (const Arrangement arrangement : kArrangements)
      for (const bool flipped : {false, true})
        robots.push_back({.variant = variant,
                          .arrangement = arrangement,
                          .flipped = flipped,
                          .objects = {cube(), cuboid(), stick(), ball()}});
  return robots;
}

inline std::string label(const RobotDescription& description) {
  return std::string(figures(description).name) + (description.flipped ? " flipped" : " upright");
}

}  // namespace trifinger::test
