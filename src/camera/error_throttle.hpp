// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <utility>

#include "trifinger/base/time.hpp"

namespace trifinger::camera {

/// Decides when an error is reported: at once, and again every minute while it lasts.
class ErrorThrottle {
 public:
  static constexpr Nanoseconds kAgain = std::chrono::minutes(1);

  /// True if this error is to be reported now.
  [[nodiscard]] bool is_due(const std::string& error, Instant now) {
    std::erase_if(reported_, [now](const auto& entry) { return now - entry.second >= kAgain; });
    lasts_ = true;
    return reported_.emplace(error, now).second;
  }
  /// The error is over. True if there was one.
  bool end() noexcept {
    reported_.clear();
    return std::exchange(lasts_, false);
  }

 private:
  std::map<std::string, Instant> reported_;
  bool lasts_{false};
};

}  // namespace trifinger::camera
