// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include "gil.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::bindings {

/// Converts seconds; None means as long as it takes. @throws InvalidArgument
[[nodiscard]] Timeout to_timeout(nanobind::handle seconds);

/// Converts seconds to a finite time. @throws InvalidArgument
[[nodiscard]] Nanoseconds to_time(double seconds);

[[nodiscard]] inline double to_seconds(Nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

/// Calls `attempt(timeout)`, a wait of the core that cannot be interrupted, for one `slice` at a
/// time. Checks for Ctrl-C between the slices.
template <class Attempt>
auto in_slices(Timeout timeout, const Attempt& attempt,
               Nanoseconds slice = std::chrono::milliseconds(100)) {
  const Deadline deadline(timeout);
  while (true) {
    try {
      const GilRelease release;
      return attempt(Timeout(deadline.remaining(slice)));
    } catch (const TimedOut&) {
      if (deadline.passed()) throw;
    }
    check_signals();
  }
}

}  // namespace trifinger::bindings
