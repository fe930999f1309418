// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "trifinger/core/errors.hpp"
#include "trifinger/core/fault.hpp"

namespace trifinger::test {

/// Returns the fault with which `call` raises RobotStopped; nothing if it returns.
template <class Call>
[[nodiscard]] std::optional<Fault> fault_of(const Call& call) {
  try {
    static_cast<void>(call());
  } catch (const RobotStopped& stopped) {
    return stopped.fault();
  }
  return std::nullopt;
}

/// Returns only the code of that fault.
template <class Call>
[[nodiscard]] Fault::Code code_of(const Call& call) {
  return fault_of(call).value_or(Fault{}).code;
}

}  // namespace trifinger::test
