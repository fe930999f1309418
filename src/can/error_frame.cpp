// SPDX-License-Identifier: BSD-3-Clause
#include "error_frame.hpp"

#include <linux/can/error.h>

namespace trifinger::can {

void note_error_frame(const can_frame& frame, BusState& state) noexcept {
  ++state.error_frames;
  const auto reports = [&frame](canid_t error) { return (frame.can_id & error) != 0; };
  if (reports(CAN_ERR_ACK)) ++state.no_acknowledgements;
  if (reports(CAN_ERR_CRTL)) {
    const unsigned controller = frame.data[1];
    constexpr unsigned kPassive = CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;
    constexpr unsigned kBetter =
        CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_ACTIVE;
    if ((controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0) ++state.controller_overflows;
    if ((controller & kPassive) != 0) {
      if (state.link != Link::kPassive) ++state.error_passives;
      state.link = Link::kPassive;
    } else if ((controller & kBetter) != 0) {
      state.link = Link::kUp;
    }
  }
  if (reports(CAN_ERR_RESTARTED)) {
    ++state.restarts;
    state.link = Link::kUp;
  }
  if (reports(CAN_ERR_BUSOFF)) {
    ++state.bus_offs;
    state.link = Link::kBusOff;
  }
}

}  // namespace trifinger::can
