// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "trifinger/base/text.hpp"

namespace trifinger::dynamixel {

/// Why a motor has not done what an instruction says: bits 0 to 6 of the error in its status.
enum class StatusError : std::uint8_t {
  kNone = 0,
  kResultFail = 1,
  kInstruction = 2,
  kCrc = 3,
  kDataRange = 4,
  kDataLength = 5,
  kDataLimit = 6,
  kAccess = 7,
};

/// In each status, this bit of the error says that the register "hardware_error_status" is not 0.
inline constexpr std::uint8_t kAlertBit = 0x80;

/// An error of a status, as words.
struct ErrorText {
  std::string_view name;      ///< A word, such as "access".
  std::string_view sentence;  ///< What happened.
  std::string_view remedy;    ///< What to do.
};

/// The words for an error. Numbers that no motor sends are "unknown".
[[nodiscard]] const ErrorText& text_of(StatusError error) noexcept;

/// The bits of the register "hardware_error_status".
enum class HardwareError : std::uint8_t {
  kInputVoltage = 0,
  kOverheating = 2,
  kEncoder = 3,
  kElectricShock = 4,
  kOverload = 5,
};

/// The bits that have a meaning.
inline constexpr std::array kHardwareErrors{
    HardwareError::kInputVoltage, HardwareError::kOverheating, HardwareError::kEncoder,
    HardwareError::kElectricShock, HardwareError::kOverload};

[[nodiscard]] constexpr std::uint8_t bit_of(HardwareError error) noexcept {
  return static_cast<std::uint8_t>(1U << static_cast<unsigned>(error));
}

/// The words for bit 0 to 7. Bits 1, 6 and 7 are "unknown".
[[nodiscard]] const ErrorText& text_of(HardwareError error) noexcept;

/// Says which bits of the register are set and what to do for each; "no hardware error" for 0.
[[nodiscard]] FixedText describe_hardware_errors(std::uint8_t bits) noexcept;

}  // namespace trifinger::dynamixel
