// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace trifinger {

/// Why robots that have a session are missing in `list_sessions()`: they belong to another user or
/// another version of this library, or their files are damaged. One sentence per robot, with the
/// remedy.
[[nodiscard]] std::vector<std::string> refused_sessions();

}  // namespace trifinger
