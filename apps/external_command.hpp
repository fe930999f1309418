// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace trifinger::apps {

// The verbs of the programs on the PATH that are called trifinger-VERB, sorted.
[[nodiscard]] std::vector<std::string> external_verbs();

// Becomes the program trifinger-`verb` with the further `arguments`. Returns if there is none.
// Throws SystemError if there is one that cannot be started.
void run_external(const std::string& verb, const std::vector<std::string>& arguments);

}  // namespace trifinger::apps
