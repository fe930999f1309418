// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace trifinger::test {

/// Makes every disk so slow that signals interrupt it. In a program that is linked with
/// interrupted_files.cpp, each call that reads, writes, cuts or syncs a file is first interrupted.
/// Then it moves only a part of what it was asked to. After this object's life, calls work as
/// usual.
class InterruptedFiles {
 public:
  InterruptedFiles() noexcept;
  InterruptedFiles(const InterruptedFiles&) = delete;
  InterruptedFiles& operator=(const InterruptedFiles&) = delete;
  ~InterruptedFiles();

  /// Returns how many calls were interrupted so far.
  [[nodiscard]] static std::int64_t count() noexcept;
};

}  // namespace trifinger::test
