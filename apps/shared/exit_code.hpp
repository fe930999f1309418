// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <stdexcept>
#include <string>

namespace trifinger::apps {

inline constexpr int kDone = 0;
inline constexpr int kFailed = 1;
inline constexpr int kWrongUsage = 2;
inline constexpr int kIncomplete = 3;  // The work was done, but its log lacks something.
inline constexpr int kNeedsRest = 5;   // The motors are warm.
inline constexpr int kOutOfReach = 6;  // The object is.

// What the user typed is not allowed. The text says what would be.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Does `work` and returns its exit code. Exceptions are reported on stderr in the name of
// `program`, which `work` may still set.
[[nodiscard]] int run_and_report(const std::string& program, const std::function<int()>& work);

}  // namespace trifinger::apps
