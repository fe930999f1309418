// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace trifinger::apps {

// Keeps the beginning and the end of an output of any length, in bounded memory.
class BoundedOutput {
 public:
  // At most `limit` bytes are kept, half of them from the beginning and half from the end.
  explicit BoundedOutput(std::uint64_t limit) : half_(static_cast<std::size_t>(limit / 2)) {}

  // Takes the next part. Returns what of it belongs to the beginning, which can be written at once.
  [[nodiscard]] std::string_view add(std::string_view text);
  // Returns what follows the beginning when nothing more will come: a line that tells how much was
  // left out, if anything was, and the end.
  [[nodiscard]] std::string rest() const;

  // Number of bytes that came.
  [[nodiscard]] std::uint64_t total() const noexcept { return total_; }
  // Number of bytes that are in neither half.
  [[nodiscard]] std::uint64_t left_out() const noexcept;

 private:
  std::size_t half_;
  std::uint64_t total_{0};
  std::string end_;  // the newest bytes after the beginning, at most two halves
};

}  // namespace trifinger::apps
