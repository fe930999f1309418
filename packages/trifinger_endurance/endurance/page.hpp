// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "endurance/history.hpp"

namespace trifinger::apps {

// What the page says besides the history.
struct PageState {
  std::string state;  // "moves", or how it ended
  bool needs_operator{false};
  bool is_over{false};  // nobody writes this page any more
  std::int64_t now{0};  // wall clock, seconds since 1970
  // What `trifinger identify --check` has found, a line of JSON each; empty: nobody checks.
  std::filesystem::path checks{};
};

// A page of a robot's health over time: one file of HTML with its plots, of a bounded size.
[[nodiscard]] std::string make_page(const History& history, const PageState& state);

}  // namespace trifinger::apps
