// SPDX-License-Identifier: BSD-3-Clause
#include "dynamixel/status.hpp"

#include <array>
#include <cstddef>

namespace trifinger::dynamixel {
namespace {

constexpr std::array<ErrorText, 9> kStatusErrors{{
    {"none", "the motor reports no error", "nothing has to be done"},
    {"result_fail", "the motor could not carry out the instruction",
     "read its hardware error status, and send the instruction again"},
    {"instruction",
     "the motor does not know the instruction, or an action came without a reg write",
     "check whether its firmware supports the instruction; fast sync read needs version 45 or "
     "later"},
    {"crc", "the instruction reached the motor damaged",
     "check cables, ground and termination, keep the bus short, or lower the baud rate"},
    {"data_range",
     "a value is outside of what its register can hold, or the bus watchdog has stopped "
     "the motor",
     "check the value, and write 0 to bus_watchdog if that reads as -1"},
    {"data_length", "a value is shorter than its register",
     "write whole registers with the sizes of the motor's control table"},
    {"data_limit", "a value is beyond a limit that is stored in the motor",
     "check current_limit, velocity_limit, pwm_limit and the limits of position of the motor"},
    {"access", "a register cannot be written now, or never",
     "switch torque off before writing a register below address 64; others can only be read"},
    {"unknown", "the motor reports an error that the protocol does not have",
     "check the type and the firmware of the motor"},
}};

constexpr ErrorText kUnknownBit{"unknown", "a bit without a known meaning is set",
                                "check the type and the firmware of the motor"};

constexpr std::array<ErrorText, 8> kHardwareTexts{{
    {"input_voltage", "the supply is outside of the motor's voltage limits",
     "check supply and cables under load"},
    kUnknownBit,
    {"overheating", "the motor is hotter than its temperature limit",
     "let it cool down, lower the load, and reboot it"},
    {"encoder", "the motor's encoder does not work", "reboot the motor; if it stays, replace it"},
    {"electric_shock", "the motor has had an electric shock, or its supply is too weak",
     "check supply and wiring, and reboot it; if it stays, replace it"},
    {"overload", "the motor was loaded beyond its torque for too long",
     "find what blocks the joint, lower the load, and reboot the motor"},
    kUnknownBit,
    kUnknownBit,
}};

}  // namespace

const ErrorText& text_of(StatusError error) noexcept {
  const auto number = static_cast<std::size_t>(error);
  return kStatusErrors[number < kStatusErrors.size() ? number : kStatusErrors.size() - 1];
}

const ErrorText& text_of(HardwareError error) noexcept {
  return kHardwareTexts[static_cast<std::size_t>(error) % kHardwareTexts.size()];
}

FixedText describe_hardware_errors(std::uint8_t bits) noexcept {
  if (bits == 0) return FixedText("no hardware error");
  FixedText text;
  const char* separator = "";
  // All that is wrong comes first, in case what to do does not fit.
  for (std::size_t bit = 0; bit < kHardwareTexts.size(); ++bit) {
    if ((bits >> bit & 1U) == 0) continue;
    text.append(separator).append(kHardwareTexts[bit].sentence);
    separator = ", and ";
  }
  separator = "; ";
  for (std::size_t bit = 0; bit < kHardwareTexts.size(); ++bit) {
    if ((bits >> bit & 1U) == 0) continue;
    text.append(separator).append(kHardwareTexts[bit].remedy);
    separator = "; ";
  }
  return text;
}

}  // namespace trifinger::dynamixel
