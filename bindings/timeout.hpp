// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include "gil.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::python {

/// Seconds, or None for as long as it takes. @throws InvalidArgument
[[nodiscard]] Timeout to_timeout(nanobind::handle seconds);

/// Seconds as a finite time. @throws InvalidArgument
[[nodiscard]] Nanoseconds to_time(double seconds);

[[nodiscard]] inline double to_seconds(Nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

/// Calls `attempt(timeout)`, a wait of the core that knows no interrupt, for a `slice` at a time
/// with a look at Ctrl-C between.
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

}  // namespace trifinger::python
