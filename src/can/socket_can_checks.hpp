// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "can/interface_state.hpp"
#include "can/socket_can.hpp"

namespace trifinger::can {

// Throws what the refusal of a CAN socket means. @throws BusUnavailable, SystemError
[[noreturn]] void throw_socket_error(int error);

// @throws BusUnavailable if `interface`, which is in this state, cannot be used now
void require_usable(const std::string& interface, const std::optional<InterfaceState>& state);

}  // namespace trifinger::can
