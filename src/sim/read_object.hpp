// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "trifinger/config/node.hpp"
#include "trifinger/model/robot_description.hpp"

namespace trifinger::detail {

// Reads an entry of the list "objects".
[[nodiscard]] ObjectDescription read_object(const config::Node& node);
// Reads the list.
[[nodiscard]] std::vector<ObjectDescription> read_objects(const config::Node& objects);

}  // namespace trifinger::detail
