// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace trifinger {

/// How much a real-time setting matters.
enum class Demand : std::uint8_t {
  kRequire,  ///< Fail if the machine refuses.
  kTry,      ///< Go on without, and say so.
  kOff,      ///< Do not ask.
};

/// What the loop's thread asks of the machine.
struct RealtimeOptions {
  Demand demand{Demand::kTry};
  int priority{80};          ///< SCHED_FIFO, 1 to 99.
  std::optional<int> cpu{};  ///< Processor to stay on; default: wherever the kernel puts it.
  bool lock_memory{true};    ///< Keep all pages in memory (mlockall).
};

/// Makes the calling thread a real-time thread, its stack touched.
/// Returns one sentence per setting that was refused, with the remedy; empty when all were granted.
/// @throws Error with these sentences if `demand` is kRequire.
std::vector<std::string> enter_realtime(const RealtimeOptions& options);

/// Lets the calling thread run even if the real-time thread that has made it never gives way: on
/// any processor, one priority above. Does nothing in an ordinary thread.
void outrank_realtime() noexcept;

}  // namespace trifinger
