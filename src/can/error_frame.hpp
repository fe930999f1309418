// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <linux/can.h>

#include "can/bus.hpp"

namespace trifinger::can {

// Notes what a controller reports in an error frame.
void note_error_frame(const can_frame& frame, BusState& state) noexcept;

}  // namespace trifinger::can
