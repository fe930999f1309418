// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "trifinger/learning/policy.hpp"

// The file of a policy, as docs/policies.md describes it.
namespace trifinger::learning::detail {

// Does not look whether the numbers make sense together: `Policy` does. Never takes more memory
// than the file at `path` has bytes, but for some that its header takes.
// Throws InvalidArgument that says what is wrong, SystemError.
[[nodiscard]] Network read_policy_file(const std::filesystem::path& path);

void write_policy_file(const Network& network, const std::filesystem::path& path);

}  // namespace trifinger::learning::detail
