// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace trifinger::test {

/// Makes every disk one that is slow enough for signals to interrupt: in a program that is linked
/// with interrupted_files.cpp each call that reads, writes, cuts or syncs a file is first
/// interrupted, then moves only a part of what it was asked to. As before behind its life.
class InterruptedFiles {
 public:
  InterruptedFiles() noexcept;
  InterruptedFiles(const InterruptedFiles&) = delete;
  InterruptedFiles& operator=(const InterruptedFiles&) = delete;
  ~InterruptedFiles();

  /// How many calls were interrupted so far.
  [[nodiscard]] static std::int64_t count() noexcept;
};

}  // namespace trifinger::test
