// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "trifinger/base/time.hpp"

namespace trifinger {

/// Why a session ended. Plain data: the back-end writes it, any process may read it.
struct Fault {
  enum class Code : std::int32_t {
    kNone = 0,

    // Clean ends: the next session begins at once.
    kFinished = 1,        ///< The controller called `finish()`.
    kDetached = 2,        ///< The controller let go without `finish()`.
    kControllerDied = 3,  ///< The controlling process ended without letting go.
    kStopped = 4,         ///< The back-end was asked to stop.
    kExhausted = 5,       ///< The driver has no further steps: the replayed log is over.

    // Faults: `recover()` is needed before the next session.
    kFirstActionLate = 16,   ///< No action arrived within the first-action timeout.
    kActionLate = 17,        ///< The action for `time_index` was missing and no repeats were left.
    kBackendLate = 18,       ///< The back-end itself was too late. `detail` counts periods at once
                             ///< if positive, steps in a row if negative.
    kActionsRejected = 19,   ///< Too many actions in a row were rejected.
    kMemoryDamaged = 20,     ///< The queue of actions was overwritten, or shared memory cut off.
    kDriver = 21,            ///< The driver gave up; `detail` is its own code.
    kDriverHangs = 22,       ///< A call of the driver did not return; the power was cut.
    kBackendDied = 23,       ///< The back-end ended without announcing it. Readers notice this.
    kMeasurementStale = 24,  ///< A measurement was too old; `detail` is its age [ms].
    kMachineSuspended = 25,  ///< The machine was suspended for `detail` [ms] while in use.
  };

  Code code{Code::kNone};
  std::int32_t detail{0};    ///< The driver's own code, or a count that belongs to `code`.
  TimeIndex time_index{-1};  ///< Step at which the session ended, -1 before step 0.

  explicit operator bool() const noexcept { return code != Code::kNone; }

  /// True for ends that `recover()` must clear.
  [[nodiscard]] bool needs_recovery() const noexcept { return code >= Code::kFirstActionLate; }

  friend bool operator==(const Fault&, const Fault&) = default;
};

/// Name of the code, such as "action_late", as Python, logs and the command line show it.
[[nodiscard]] std::string_view name_of(Fault::Code code) noexcept;

/// One sentence: what happened at which step, and what to do about it. `driver_text` is the
/// driver's text about its fault, or about the last action that it rejected. It may be empty.
[[nodiscard]] std::string describe(const Fault& fault, std::string_view driver_text = {});

}  // namespace trifinger
