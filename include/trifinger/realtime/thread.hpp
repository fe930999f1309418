// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace trifinger {

/// How much the real-time settings matter.
enum class Demand : std::uint8_t {
  kRequire,  ///< Fail if the machine refuses one.
  kTry,      ///< Go on without, and say so.
  kOff,      ///< Ask for none.
};

/// What the loop's thread asks of the machine. docs/real_time.md sets up one that grants it all.
struct RealtimeOptions {
  Demand demand{Demand::kTry};  ///< Of everything below.
  int priority{80};             ///< SCHED_FIFO, 1 to 99.
  std::optional<int> cpu{};     ///< Processor to stay on; default: wherever the kernel puts it.
  bool lock_memory{true};       ///< Keep all pages of the process in memory, those to come as well.
  std::size_t heap{8U << 20U};  ///< Memory that is there before it is asked for [bytes]. With it
                                ///< the process gives back no memory to the machine; 0: as usual.
  bool keep_cpus_awake{true};   ///< Keep all processors out of states that they wake from slowly,
                                ///< as long as the thread lives. Costs power.
};

/// Makes the calling thread a real-time thread, its stack touched.
/// Returns one sentence per setting that was refused, with the remedy; empty when all were granted.
/// @throws Error with these sentences if `demand` is kRequire.
std::vector<std::string> enter_realtime(const RealtimeOptions& options);

/// What the calling thread lacks to be a real-time thread: the sentences that `enter_realtime` has
/// returned here, or one that says that nobody has asked for anything.
[[nodiscard]] std::vector<std::string> realtime_lacks();

/// Lets the calling thread run even if the real-time thread that has made it never gives way: on
/// any processor, one priority above, which `enter_realtime` has tried. Does nothing in an ordinary
/// thread.
void outrank_realtime() noexcept;

}  // namespace trifinger
