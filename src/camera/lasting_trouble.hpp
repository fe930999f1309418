// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <utility>

#include "trifinger/base/time.hpp"

namespace trifinger::camera {

/// Decides when a trouble is told: at once, and again every minute while it lasts.
class LastingTrouble {
 public:
  static constexpr Nanoseconds kAgain = std::chrono::minutes(1);

  /// True if this sentence is to be told now.
  [[nodiscard]] bool is_news(const std::string& sentence, Instant now) {
    std::erase_if(told_, [now](const auto& entry) { return now - entry.second >= kAgain; });
    lasts_ = true;
    return told_.emplace(sentence, now).second;
  }
  /// The trouble is over. True if there was one.
  bool end() noexcept {
    told_.clear();
    return std::exchange(lasts_, false);
  }

 private:
  std::map<std::string, Instant> told_;
  bool lasts_{false};
};

}  // namespace trifinger::camera
