// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/bounded_output.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace trifinger::apps {

std::string_view BoundedOutput::add(std::string_view text) {
  const std::size_t room = total_ < half_ ? half_ - static_cast<std::size_t>(total_) : 0;
  const std::string_view beginning = text.substr(0, room);
  total_ += text.size();
  text.remove_prefix(beginning.size());
  // Only the last half can be needed of a part that is longer.
  if (text.size() > half_) text.remove_prefix(text.size() - half_);
  end_ += text;
  // Cutting only now and then keeps the cost of a byte constant.
  if (end_.size() > 2 * half_) end_.erase(0, end_.size() - half_);
  return beginning;
}

std::string BoundedOutput::rest() const {
  std::string end = end_.substr(end_.size() - std::min(end_.size(), half_));
  if (left_out() == 0) return end;
  return fmt::format("\n[{} bytes are left out here]\n{}", left_out(), end);
}

std::uint64_t BoundedOutput::left_out() const noexcept {
  const std::uint64_t kept = 2 * static_cast<std::uint64_t>(half_);
  return total_ > kept ? total_ - kept : 0;
}

}  // namespace trifinger::apps
