// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "trifinger/learning/policy.hpp"

// The file format is described in docs/policies.md.
namespace trifinger::learning::detail {

// Reads the file of a policy. Does not check whether the numbers fit together: `Policy` does. Takes
// no more memory than the size of the file plus some for its header. Throws InvalidArgument, which
// says what is wrong, and SystemError.
[[nodiscard]] Network read_policy_file(const std::filesystem::path& path);

void write_policy_file(const Network& network, const std::filesystem::path& path);

}  // namespace trifinger::learning::detail
