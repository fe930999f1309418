// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace trifinger::apps {

// Whether the kernel has filters of system calls, and this program one for this processor.
[[nodiscard]] bool can_forbid_hidden_memory() noexcept;

// From now on this thread, and all that it starts, cannot make namespaces, in which it could mount
// file systems of memory, and no System V segments or queues, which are memory that no process
// shows. Programs for other processors than this one get no system calls. Needs NO_NEW_PRIVS.
// False if the kernel refuses.
[[nodiscard]] bool forbid_hidden_memory() noexcept;

}  // namespace trifinger::apps
