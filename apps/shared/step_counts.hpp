// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "trifinger/core/status.hpp"

namespace trifinger::apps {

// Counts what the statuses of steps say.
struct StepCounts {
  std::int64_t steps{0};
  std::int64_t repeats{0};
  std::int64_t rejected{0};
  std::int64_t acausal{0};
  std::int64_t skipped{0};  // number of skipped ticks

  // `flags` and `skipped_ticks` are those of the step's status.
  void add(std::uint32_t flags, std::uint32_t skipped_ticks) noexcept {
    ++steps;
    repeats += (flags & Status::kActionRepeated) != 0 ? 1 : 0;
    rejected += (flags & Status::kActionRejected) != 0 ? 1 : 0;
    acausal += (flags & Status::kAcausal) != 0 ? 1 : 0;
    skipped += skipped_ticks;
  }
};

}  // namespace trifinger::apps
