// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace trifinger {

/// How strictly the real-time settings are required.
enum class Demand : std::uint8_t {
  kRequire,  ///< Fail if the machine refuses one.
  kTry,      ///< Go on without a refused setting, and report it.
  kOff,      ///< Request no setting.
};

/// What the loop's thread requests from the machine. docs/real_time.md describes how to set up a
/// machine that grants everything.
struct RealtimeOptions {
  Demand demand{Demand::kTry};  ///< Applies to all settings below.
  int priority{80};             ///< SCHED_FIFO, 1 to 99.
  std::optional<int> cpu{};     ///< Processor to stay on; default: the kernel chooses.
  bool lock_memory{true};       ///< Keeps all pages of the process in memory, future ones, too.
  std::size_t heap{8U << 20U};  ///< Memory that is reserved in advance [bytes]. With it the process
                                ///< returns no memory to the machine; 0 reserves none.
  bool keep_cpus_awake{true};   ///< Keeps all processors out of states from which they wake slowly,
                                ///< as long as the thread lives. Costs power.
};

/// Makes the calling thread a real-time thread and touches its stack. Returns one sentence per
/// refused setting, with the remedy; empty if all were granted.
/// @throws Error with these sentences if `demand` is kRequire.
std::vector<std::string> enter_realtime(const RealtimeOptions& options);

/// What keeps the calling thread from being a real-time thread. Returns the sentences that
/// `enter_realtime` has returned in this thread, or a sentence that says that nobody has called it.
[[nodiscard]] std::vector<std::string> realtime_warnings();

/// Lets the calling thread run even if the real-time thread that made it never yields. The calling
/// thread may use any processor and gets a priority one higher, which `enter_realtime` has tried.
/// Does nothing if an ordinary thread made the calling thread.
void outrank_realtime() noexcept;

/// Makes the calling thread an ordinary one, whatever thread made it: without real-time priority,
/// and on any processor. Threads that it makes from now on are ordinary, too. Does nothing to an
/// ordinary thread.
void leave_realtime() noexcept;

}  // namespace trifinger
