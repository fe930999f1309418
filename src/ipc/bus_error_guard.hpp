// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace trifinger::ipc {

// Touching a page of a mapped file that another process has truncated raises SIGBUS. Inside a
// guarded range the handler maps a page of zeros there and notes the damage. Outside, the signal
// goes to the previous handler.

// Guards a range and returns its entry, for the functions below. Throws Error if there are more
// mappings than the table can hold.
[[nodiscard]] int guard_range(std::byte* data, std::size_t size);
void release_range(int entry) noexcept;
[[nodiscard]] bool is_range_damaged(int entry) noexcept;

}  // namespace trifinger::ipc
