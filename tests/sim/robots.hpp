// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::test {

inline constexpr Variant kVariants[] = {Variant::kEdu, Variant::kPro, Variant::kOne};

template <class R>
inline constexpr Arrangement kArrangement =
    R::kTips == 1 ? Arrangement::kSingleFinger : Arrangement::kTriFinger;

/// Returns the default simulation of a variant as an R.
template <class R>
SimulationOptions options_of(Variant variant = Variant::kEdu) {
  SimulationOptions options;
  options.description.variant = variant;
  options.description.arrangement = kArrangement<R>;
  return options;
}

/// Returns every variant as an R, upright and flipped.
template <class R>
std::vector<SimulationOptions> all_variants() {
  std::vector<SimulationOptions> all;
  for (const Variant variant : kVariants) {
    for (const bool flipped : {false, true}) {
      all.push_back(options_of<R>(variant));
      all.back().description.flipped = flipped;
    }
  }
  return all;
}

inline std::string label(const SimulationOptions& options) {
  return std::string(figures(options.description).name) +
         (options.description.flipped ? " flipped" : " upright");
}

}  // namespace trifinger::test
