// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace trifinger::apps {

// Whether the kernel has filters of system calls, and this program one for this processor.
[[nodiscard]] bool can_forbid_hidden_memory() noexcept;

// From now on this thread, and all that it starts, cannot make namespaces, in which it could mount
// file systems of memory, nor take memory that the kernel shows in no process and does not bound:
// System V segments, queues and semaphores, secret memory, rings of io_uring, of bpf and of perf,
// pages that are given to a pipe. Programs for other processors than this one get no system calls.
// Needs NO_NEW_PRIVS. False if the kernel refuses.
[[nodiscard]] bool forbid_hidden_memory() noexcept;

}  // namespace trifinger::apps
