// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "can/motor_board.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::boards {

/// Something that goes wrong with a robot on emulated motor boards.
struct EmulatedFault {
  enum class Kind : std::uint8_t {
    kPowerOff,       ///< No board has a supply.
    kPowerOn,        ///< The boards that are off get their supply back.
    kBoardOff,       ///< One board has none.
    kBoardRestart,   ///< It has none for a moment.
    kBoardSilent,    ///< Nothing that it sends arrives.
    kBoardError,     ///< It reports `error`, unless it is switched off or not enabled.
    kBoardRollover,  ///< It restarts, and its positions count from just below their rollover.
    kBusLoses,       ///< This share of the frames is lost: `amount`, 0 to 1.
    kBusDuplicates,  ///< ... comes twice.
    kBusDelays,      ///< ... is late by up to `time`, also after later ones.
    kBusCorrupts,    ///< ... comes with another id, length or content.
    kBusFlooded,     ///< Another node sends `amount` frames per second.
    kBusFull,        ///< Boards can send nothing.
    kBusOff,         ///< The controllers have left the bus.
    kBusDown,        ///< The interface is down.
    kBusGone,        ///< The interface was removed: for ever.
    kJointJumps,     ///< Its encoder is off by `amount` [rad].
    kJointStuck,     ///< Its encoder stands still.
    kJointNoisy,     ///< Its encoder is off by up to `amount` [rad], differently each time.
    kJointHot,       ///< Its motor gets `amount` times the current.
    kJointLoose,     ///< Its motor turns without it.
    kJointReversed,  ///< Its motor turns the other way.
    kJointsSwapped,  ///< The motors of the joints `number` and `other` are exchanged.
  };

  Kind kind{};
  std::size_t number{0};  ///< Of the board, bus or joint.
  std::size_t other{0};
  double amount{0.0};
  Nanoseconds time{};
  can::BoardError error{can::BoardError::kNone};
  std::optional<Nanoseconds> at{};        ///< When it begins; without it, now.
  std::optional<Nanoseconds> duration{};  ///< How long it lasts; without it, for ever.

  friend bool operator==(const EmulatedFault&, const EmulatedFault&) = default;
};

/// Reads a text such as "board 3 silent at 5 s for 0.2 s".
/// @throws InvalidArgument that names the word that is not understood, and those that are
[[nodiscard]] EmulatedFault parse_fault(std::string_view text);

/// The texts that `parse_fault` understands, one per line.
[[nodiscard]] std::string fault_texts();

}  // namespace trifinger::boards
