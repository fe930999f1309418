// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>

#include "trifinger/base/time.hpp"

namespace trifinger::ipc {

/// Sleeps while `word` holds `expected`, at most `timeout`. Works across processes and on read-only
/// mappings; `std::atomic::wait` does neither with this standard library. May return early for no
/// reason: look again.
void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                Nanoseconds timeout) noexcept;

/// Wakes everyone who sleeps on `word`.
void futex_wake_all(const std::atomic<std::uint32_t>& word) noexcept;

}  // namespace trifinger::ipc
