// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace trifinger::ipc {

// Touching a page of a mapped file that another process has cut off raises SIGBUS. Inside a guarded
// range the handler puts a page of zeros there and notes the damage; elsewhere the signal goes
// where it went before.

// Returns the entry of the range, to be given to the functions below.
// Throws Error if there are more mappings than the table holds.
[[nodiscard]] int guard_range(std::byte* data, std::size_t size);
void release_range(int entry) noexcept;
[[nodiscard]] bool is_range_damaged(int entry) noexcept;

}  // namespace trifinger::ipc
