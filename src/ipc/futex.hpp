// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>

#include "trifinger/base/time.hpp"

namespace trifinger::ipc {

/// Sleeps while `word` holds `expected`, at most for `timeout`. It works across processes and on
/// read-only mappings; `std::atomic::wait` of this standard library supports neither. It may return
/// early for no reason, so check the word again.
void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                Nanoseconds timeout) noexcept;

/// Wakes everyone who sleeps on `word`.
void futex_wake_all(const std::atomic<std::uint32_t>& word) noexcept;

}  // namespace trifinger::ipc
