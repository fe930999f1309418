// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "trifinger/core/session.hpp"

namespace trifinger::apps {

// Returns the running hours of a robot as a table: a sentence, a heading, a line for each joint.
// Empty if the robot counts none, or nothing yet.
[[nodiscard]] std::vector<std::string> wear_table(const Session& robot);

}  // namespace trifinger::apps
