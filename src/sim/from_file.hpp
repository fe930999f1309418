// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/config/node.hpp"

namespace trifinger::detail {

// True if the section "robot" names a file with a model.
[[nodiscard]] inline bool is_from_file(const config::Node& root) {
  const auto robot = root.optional_section("robot");
  return robot && (robot->find("mjcf") || robot->find("urdf"));
}

}  // namespace trifinger::detail
