// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "trifinger/manipulation/task.hpp"

namespace trifinger::manipulation {

/// Reads a configuration: the path of a file, or the name of one that comes with the program, for
/// example "edu". `task` is "lift" or "slide" and selects the section of that name.
/// config/manipulate/edu.yml documents every key.
/// @throws config::ConfigError at the value that is wrong, InvalidArgument, SystemError
[[nodiscard]] ManipulationConfig load_config(const std::string& name, const std::string& task,
                                             const std::vector<std::string>& overrides = {});

}  // namespace trifinger::manipulation
