// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "robot/finding.hpp"

namespace trifinger::apps {

// Judges whether the images of a running robot's cameras fit together, by what they show of its
// objects, and says what is wrong if they do not. Waits some seconds for images in which they do.
// Throws InvalidArgument if the robot has no objects, or no cameras.
[[nodiscard]] std::vector<Finding> examine_cameras(const std::string& robot);

}  // namespace trifinger::apps
