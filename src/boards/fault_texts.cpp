// SPDX-License-Identifier: BSD-3-Clause
#include "fault_texts.hpp"

namespace trifinger::boards {

FaultText text_of(BoardFault fault) noexcept {
  switch (fault) {
    case BoardFault::kInterfaceDown:
      return {"its CAN interface is down",
              "bring it up ('ip link set INTERFACE up'), then recover"};
    case BoardFault::kInterfaceGone:
      return {"its CAN interface was removed", "plug it in, then start the robot again"};
    case BoardFault::kBusOff:
      return {"the CAN controller has left the bus after too many errors",
              "check cable and termination, restart the interface, then recover"};
    case BoardFault::kSilent:
      return {"no measurements come", "check its supply and its cable, then recover"};
    case BoardFault::kSecondHost:
      return {"somebody else sends commands on its bus",
              "end the other program or unplug the other computer, then recover"};
    case BoardFault::kSendRefused:
      return {"its bus takes no frames, so nobody acknowledges them",
              "check the board's supply and its cable, then recover"};
    case BoardFault::kRestarted:
      return {"its motors are switched off",
              "it has lost its supply, or its button was pressed; recover: the robot homes itself"};
    case BoardFault::kNoCurrent:
      return {"a motor gets no current",
              "check supply and emergency stop, or the board has an error; then recover"};
    case BoardFault::kNotReady:
      return {"it did not become ready",
              "check its supply, its cable and its motors, then recover"};
    case BoardFault::kNone:
    case BoardFault::kError:
      break;
  }
  return {};
}

std::string_view text_of(JointHoming::Failure failure) noexcept {
  switch (failure) {
    case JointHoming::Failure::kTooFar:
      return "did not find its end stop within the largest travel; check the belt and the stop";
    case JointHoming::Failure::kNoIndex:
      return "found no index of its encoder within 1.5 revolutions of its motor; check the encoder";
    case JointHoming::Failure::kNone:
      break;
  }
  return {};
}

}  // namespace trifinger::boards
